//! XML files → one tree of elements: included files are in place, `$name` is replaced, and names are
//! those of version 3.

use std::{
    collections::HashMap,
    fs,
    path::{Component, Path, PathBuf},
};

use roxmltree::ParsingOptions;

use super::text::{self, Lines, snake_case};
use crate::{
    error::{Error, Result},
    files,
};

/// Deepest nesting of elements, included files counted.
const MAX_DEPTH: usize = 32;
/// Most elements of all files together; a file may be included many times.
const MAX_ELEMENTS: usize = 1 << 21;
/// Most bytes of a file.
const MAX_FILE_BYTES: u64 = 1 << 28;
/// Most files that are included.
const MAX_INCLUDES: usize = 256;
/// Most characters of a value with its `$name` replaced: defaults may name each other.
const MAX_VALUE: usize = 1 << 16;

/// Elements of a scene file and those that it includes.
#[derive(Debug)]
pub(super) struct Document {
    elements: Vec<Element>,
    /// Files in the order in which they were met; the scene first.
    pub files: Vec<PathBuf>,
    /// Folder of the scene, which no path leaves.
    folder: PathBuf,
    /// Folders of `path`, within that of the scene.
    search: Vec<PathBuf>,
    /// Element of each name.
    ids: HashMap<String, usize>,
}

#[derive(Debug)]
struct Element {
    tag: String,
    attributes: Vec<(String, String)>,
    children: Vec<usize>,
    file: usize,
    line: u32,
}

/// Element of a [`Document`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Node<'a> {
    /// The document.
    pub document: &'a Document,
    /// Number of the element, by which it is told from others.
    pub index: usize,
}

impl<'a> Node<'a> {
    fn element(self) -> &'a Element {
        &self.document.elements[self.index]
    }

    /// Name of the element.
    pub(super) fn tag(self) -> &'a str {
        &self.element().tag
    }

    /// Value of an attribute.
    pub(super) fn attribute(self, name: &str) -> Option<&'a str> {
        let found = self.element().attributes.iter().find(|(own, _)| own == name);
        found.map(|(_, value)| value.as_str())
    }

    /// Name of the parameter that the element is; empty if it has none.
    pub(super) fn name(self) -> &'a str {
        self.attribute("name").unwrap_or_default()
    }

    /// Type of the plugin; empty if it has none.
    pub(super) fn kind(self) -> &'a str {
        self.attribute("type").unwrap_or_default()
    }

    /// Elements in this one, in their order.
    pub(super) fn children(self) -> impl Iterator<Item = Node<'a>> {
        let document = self.document;
        self.element().children.iter().map(move |&index| Node { document, index })
    }

    /// Element that a `ref` names; any other is itself.
    pub(super) fn target(self) -> Result<Node<'a>> {
        if self.tag() != "ref" {
            return Ok(self);
        }
        let id = self.attribute("id").unwrap_or_default();
        match self.document.ids.get(id) {
            Some(&index) => Ok(Node { document: self.document, index }),
            None => Err(self.error(format!("expected the id of an object, found `{id}`"))),
        }
    }

    /// Line for warnings, with the file where it is not the scene.
    pub(super) fn place(self) -> String {
        let Element { file, line, .. } = self.element();
        if *file == 0 {
            format!("line {line}")
        } else {
            format!("{}:{line}", self.document.files[*file].display())
        }
    }

    /// Error at this element.
    pub(super) fn error(self, message: impl Into<String>) -> Error {
        let Element { file, line, .. } = self.element();
        Error::parse(&self.document.files[*file], *line as usize, 1, message)
    }

    /// Path of a file that the element names: in the scene's folder, or in one of its `path`s.
    ///
    /// # Errors
    /// [`Error::Parse`] for a name that leaves the folder of the scene, or a file that is not there.
    pub(super) fn file(self, name: &str) -> Result<PathBuf> {
        let document = self.document;
        document.resolve(name).map_err(|message| self.error(message))
    }
}

impl Document {
    /// Reads the scene file and all that it includes.
    ///
    /// # Errors
    /// [`Error::Parse`] with the line, and errors of reading.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let mut builder = Builder {
            document: Self {
                elements: Vec::new(),
                files: Vec::new(),
                folder: files::parent_of(path).to_path_buf(),
                search: Vec::new(),
                ids: HashMap::new(),
            },
            defaults: HashMap::new(),
            open: Vec::new(),
        };
        let root = Element {
            tag: "scene".to_owned(),
            attributes: Vec::new(),
            children: Vec::new(),
            file: 0,
            line: 1,
        };
        builder.document.elements.push(root);
        builder.file(path, 0, 0)?;
        Ok(builder.document)
    }

    /// Element of the whole scene.
    pub(super) fn root(&self) -> Node<'_> {
        Node { document: self, index: 0 }
    }

    /// Finds a file by its name; the message of an error names it.
    fn resolve(&self, name: &str) -> Result<PathBuf, String> {
        let inside = inside(name)?;
        let mut folders = vec![Path::new("")];
        folders.extend(self.search.iter().map(PathBuf::as_path));
        let paths = folders.iter().map(|folder| self.folder.join(folder).join(&inside));
        let found = paths.clone().find(|path| path.exists());
        found.ok_or_else(|| {
            let sought: Vec<_> = paths.map(|path| path.display().to_string()).collect();
            format!("the file `{name}` is not there; expected {}", sought.join(" or "))
        })
    }
}

/// Checks that a name stays in the folder that it is relative to.
fn inside(name: &str) -> Result<PathBuf, String> {
    let slashed = name.replace('\\', "/");
    let mut inside = PathBuf::new();
    let is_absolute = slashed.starts_with('/')
        || slashed.split('/').next().is_some_and(|first| first.contains(':'));
    let mut leaves = is_absolute || slashed.contains('\0');
    for component in Path::new(&slashed).components() {
        match component {
            Component::Normal(part) => inside.push(part),
            Component::CurDir => {}
            Component::ParentDir => leaves |= !inside.pop(),
            Component::RootDir | Component::Prefix(_) => leaves = true,
        }
    }
    if leaves || inside.as_os_str().is_empty() {
        return Err(format!(
            "the file name `{name}` is empty, absolute or leaves the folder of the scene; expected \
             a file in that folder or below: put it there and name it relative to the scene"
        ));
    }
    Ok(inside)
}

struct Builder {
    document: Document,
    defaults: HashMap<String, String>,
    /// Files being read, for a file that includes itself.
    open: Vec<PathBuf>,
}

impl Builder {
    /// Adds the elements of a file to those of `parent`.
    fn file(&mut self, path: &Path, parent: usize, depth: usize) -> Result<()> {
        let bytes = fs::metadata(path).map_or(0, |metadata| metadata.len());
        if bytes > MAX_FILE_BYTES {
            let message = format!("expected at most {MAX_FILE_BYTES} bytes of XML, found {bytes}");
            return Err(Error::format(path, message));
        }
        let xml_text = files::read_text(path)?;
        let file = self.document.files.len();
        self.document.files.push(path.to_path_buf());
        self.open.push(path.to_path_buf());
        text::check_nesting(path, &xml_text, MAX_DEPTH)?;
        // A document type could define entities, which the format has no use for.
        let options =
            ParsingOptions { nodes_limit: 8 * MAX_ELEMENTS as u32, ..ParsingOptions::default() };
        let xml = roxmltree::Document::parse_with_options(&xml_text, options).map_err(|error| {
            let at = error.pos();
            Error::parse(path, at.row as usize, at.col as usize, error.to_string())
        })?;
        let root = xml.root_element();
        let lines = Lines::new(&xml_text);
        if root.tag_name().name() != "scene" {
            let message = format!(
                "expected the element `scene` of a Mitsuba file, found `{}`",
                root.tag_name().name()
            );
            return Err(Error::parse(path, lines.line(root.range().start) as usize, 1, message));
        }
        let source = Source { path, file, lines: &lines };
        for child in root.children().filter(roxmltree::Node::is_element) {
            self.element(&source, child, parent, depth + 1)?;
        }
        self.open.pop();
        Ok(())
    }

    fn element(
        &mut self,
        source: &Source,
        node: roxmltree::Node,
        parent: usize,
        depth: usize,
    ) -> Result<()> {
        let line = source.lines.line(node.range().start);
        let error = |message: String| Error::parse(source.path, line as usize, 1, message);
        if depth > MAX_DEPTH {
            return Err(error(format!("elements are nested deeper than {MAX_DEPTH}")));
        }
        if self.document.elements.len() >= MAX_ELEMENTS {
            return Err(error(format!("more than {MAX_ELEMENTS} elements")));
        }
        let tag = node.tag_name().name();
        let mut attributes = Vec::new();
        for attribute in node.attributes() {
            let value = self.replace(attribute.value()).map_err(error)?;
            let is_name = attribute.name() == "name" && tag != "default";
            let value = if is_name { snake_case(&value) } else { value };
            attributes.push((attribute.name().to_owned(), value));
        }
        let attribute = |name: &str| {
            let found = attributes.iter().find(|(own, _)| own == name);
            found
                .map(|(_, value)| value.clone())
                .ok_or_else(|| error(format!("`{tag}`: expected the attribute `{name}`")))
        };
        match tag {
            "default" => {
                let (name, value) = (attribute("name")?, attribute("value")?);
                self.defaults.entry(name).or_insert(value);
                return Ok(());
            }
            "path" => {
                let folder = inside(&attribute("value")?).map_err(error)?;
                self.document.search.push(folder);
                return Ok(());
            }
            "alias" => {
                let (id, alias) = (attribute("id")?, attribute("as")?);
                let Some(&index) = self.document.ids.get(&id) else {
                    return Err(error(format!("alias: expected an id above, found `{id}`")));
                };
                self.document.ids.insert(alias, index);
                return Ok(());
            }
            "include" => return self.include(&attribute("filename")?, parent, depth, &error),
            _ => {}
        }
        let index = self.document.elements.len();
        let id = if tag == "ref" { None } else { attribute("id").ok() };
        let element = Element {
            tag: tag.to_owned(),
            attributes,
            children: Vec::new(),
            file: source.file,
            line,
        };
        self.document.elements.push(element);
        self.document.elements[parent].children.push(index);
        if let Some(id) = id
            && let Some(first) = self.document.ids.insert(id.clone(), index)
        {
            let place = Node { document: &self.document, index: first }.place();
            return Err(error(format!("the id `{id}` is taken by the element of {place}")));
        }
        for child in node.children().filter(roxmltree::Node::is_element) {
            self.element(source, child, index, depth + 1)?;
        }
        Ok(())
    }

    fn include(
        &mut self,
        name: &str,
        parent: usize,
        depth: usize,
        error: &dyn Fn(String) -> Error,
    ) -> Result<()> {
        let path = self.document.resolve(name).map_err(error)?;
        if self.document.files.len() > MAX_INCLUDES {
            return Err(error(format!("more than {MAX_INCLUDES} files are included")));
        }
        if self.open.iter().any(|open| files::is_same_file(open, &path)) {
            return Err(error(format!("`{name}` includes itself")));
        }
        self.file(&path, parent, depth)
    }

    /// Replaces `$name` by the value of its `default`, the longest name first, as Mitsuba does.
    fn replace(&self, value: &str) -> Result<String, String> {
        let mut replaced = String::with_capacity(value.len());
        let mut rest = value;
        while let Some(at) = rest.find('$') {
            replaced.push_str(&rest[..at]);
            rest = &rest[at + 1..];
            let is_start = |(name, _): &(&String, &String)| rest.starts_with(name.as_str());
            let longest = self.defaults.iter().filter(is_start).max_by_key(|(name, _)| name.len());
            let Some((name, default)) = longest else {
                let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_');
                let name = &rest[..end.unwrap_or(rest.len())];
                return Err(format!(
                    "`${name}` has no value; expected `<default name=\"{name}\" value=\"…\"/>` above"
                ));
            };
            replaced.push_str(default);
            rest = &rest[name.len()..];
            if replaced.len() > MAX_VALUE {
                return Err(format!("a value of more than {MAX_VALUE} characters"));
            }
        }
        replaced.push_str(rest);
        Ok(replaced)
    }
}

/// File being read.
struct Source<'a> {
    path: &'a Path,
    file: usize,
    lines: &'a Lines,
}
