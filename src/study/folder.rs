//! The report folder: layout of its files, and records that are written and read back.
//!
//! ```text
//! study.json                       marks the folder
//! results.json, results.csv        every run
//! index.html                       the page
//! runs/SCENE/SAMPLER-RULE-seedN.json
//! runs/SCENE/overhead-N.json
//! images/SCENE/surfaces.exr        where the camera sees surfaces alone
//! images/SCENE/reference_1.exr, reference_2.exr, reference.png
//! images/SCENE/SAMPLER-RULE-seedN.exr, .png
//! images/SCENE/SAMPLER-RULE-error.png
//! ```

use std::{
    fs::{self, File, TryLockError},
    path::{Path, PathBuf},
    sync::Arc,
};

use serde::{Serialize, de::DeserializeOwned};

use crate::{
    error::{Error, Result},
    files::{check_replaces_nothing_in, check_writable, write_json},
};

const MARK: &str = "study.json";
const FORMAT: &str = "fenestra study 3";

#[derive(Clone, Debug)]
pub struct Folder {
    pub(crate) path: PathBuf,
    /// The mark, locked while a study writes here; the system unlocks it when the program ends.
    _lock: Option<Arc<File>>,
}

#[derive(Serialize, serde::Deserialize)]
struct Mark {
    format: String,
}

impl Folder {
    /// Opens a report folder, creating one where the folder is absent or empty, and locks it
    /// against other studies. Fails if `path` holds something else, cannot be written, or if another study is
    /// at work in it.
    pub(crate) fn open(path: &Path) -> Result<Self> {
        let folder = Self { path: path.to_path_buf(), _lock: None };
        let mark = path.join(MARK);
        if path.exists() && !path.is_dir() {
            return Err(Error::format(path, "expected a folder for the report, found a file"));
        }
        if mark.exists() {
            let found: Option<Mark> = folder.read_json(&mark)?;
            let format = found.map(|mark| mark.format).unwrap_or_default();
            if format != FORMAT {
                let message = format!(
                    "expected format {FORMAT:?}, found {format:?}: a study of another version, whose \
                     figures cannot be mixed with these; choose another folder with -o, or give its \
                     references by --reference FOLDER"
                );
                return Err(Error::format(&mark, message));
            }
            check_writable(&path.join("results.json"))?;
            return folder.locked();
        }
        if path.is_dir() {
            let mut entries =
                fs::read_dir(path).map_err(|source| Error::io(path, "read", source))?;
            if let Some(Ok(entry)) = entries.next() {
                let message = format!(
                    "the folder holds something else than a study ({}); choose an empty or new one with -o",
                    entry.file_name().display()
                );
                return Err(Error::format(path, message));
            }
        }
        write_json(&mark, &Mark { format: FORMAT.to_owned() })?;
        folder.locked()
    }

    fn locked(self) -> Result<Self> {
        let mark = self.path.join(MARK);
        let file = File::open(&mark).map_err(|source| Error::io(&mark, "open", source))?;
        match file.try_lock() {
            Ok(()) => Ok(Self { _lock: Some(Arc::new(file)), ..self }),
            Err(TryLockError::WouldBlock) => Err(Error::usage(format!(
                "{}: another study is at work in this folder; wait for its end, or choose another folder \
                 with -o",
                self.path.display()
            ))),
            // Some network file systems have no locks.
            Err(TryLockError::Error(error)) if error.kind() == std::io::ErrorKind::Unsupported => {
                Ok(self)
            }
            Err(TryLockError::Error(source)) => Err(Error::io(&mark, "lock", source)),
        }
    }

    /// Opens the folder of another study for reading. Fails with [`Error::Format`] if it is no report folder.
    pub(crate) fn existing(path: &Path) -> Result<Self> {
        if path.join(MARK).exists() {
            Ok(Self { path: path.to_path_buf(), _lock: None })
        } else {
            Err(Error::format(path, format!("expected the report folder of a study: no {MARK}")))
        }
    }

    /// Checks that no input lies in the folder.
    pub(crate) fn check_replaces_nothing(&self, inputs: &[&Path]) -> Result<()> {
        check_replaces_nothing_in("the report in", &self.path, inputs)
    }

    pub(crate) fn run(&self, scene: &str, stem: &str) -> PathBuf {
        self.path.join("runs").join(scene).join(format!("{stem}.json"))
    }

    pub(crate) fn round(&self, scene: &str, repetition: u32) -> PathBuf {
        self.run(scene, &format!("overhead-{repetition}"))
    }

    /// Path of the picture of a run or reference inside this folder.
    pub(crate) fn image_name(scene: &str, stem: &str) -> String {
        format!("images/{scene}/{stem}.exr")
    }

    /// Path of the picture of a run or reference.
    pub(crate) fn image(&self, scene: &str, stem: &str) -> PathBuf {
        self.path.join(Self::image_name(scene, stem))
    }

    /// Reads such a file, or `None` if there is no such file. Fails with [`Error::Format`] if it holds
    /// something else.
    pub(crate) fn read_json<T: DeserializeOwned>(&self, path: &Path) -> Result<Option<T>> {
        let text = match fs::read_to_string(path) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            result => result.map_err(|source| Error::io(path, "read", source))?,
        };
        serde_json::from_str(&text).map(Some).map_err(|error| {
            Error::format(path, format!("damaged file ({error}); delete the file to redo the run"))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn records_come_back() {
        let parent = tempfile::tempdir().unwrap();
        let folder = Folder::open(&parent.path().join("report")).unwrap();
        let path = folder.run("room", "mis-4spp-seed1");
        assert_eq!(folder.read_json::<Vec<u32>>(&path).unwrap(), None);
        write_json(&path, &[1, 2, 3]).unwrap();
        let other = Folder::open(&folder.path).unwrap_err().to_string();
        assert!(other.contains("another study is at work"), "{other}");
        let folder_path = folder.path.clone();
        drop(folder);
        let again = Folder::open(&folder_path).unwrap();
        assert_eq!(again.read_json(&path).unwrap(), Some(vec![1, 2, 3]));
        fs::write(&path, "[1, 2").unwrap();
        assert!(again.read_json::<Vec<u32>>(&path).unwrap_err().to_string().contains("damaged"));
    }

    #[test]
    fn another_version_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(MARK), r#"{"format": "fenestra study 2"}"#).unwrap();
        let error = Folder::open(folder.path()).unwrap_err().to_string();
        assert!(error.contains("another version") && error.contains("--reference"), "{error}");
    }
}
