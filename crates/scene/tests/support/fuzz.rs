//! Mutated inputs for parsers, and worker processes that try them with limited memory and time.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "tests may panic")]

use std::{
    collections::BTreeMap,
    env,
    fs::{self, File},
    io::Write,
    ops::Range,
    os::unix::fs::FileExt,
    panic::{self, AssertUnwindSafe},
    path::{Path, PathBuf},
    process::{self, Command, Stdio},
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use fenestra_scene::memory;

/// Longest time that one input may take.
const TIME_LIMIT: Duration = Duration::from_secs(60);
/// Memory that the program allows itself in a worker, as `--max-memory` does, bytes.
const ALLOWED_BYTES: u64 = 384 << 20;
/// Address space of a worker, KiB: that, stacks and arenas of threads. An allocation that passes it
/// aborts the worker, and was not checked.
const MEMORY_LIMIT_KIB: u32 = 1_200_000;
/// Longest input that mutations may grow to, relative to the seeds.
const LARGEST_GROWTH: usize = 4;
/// Crashes of workers after which a target is given up.
const MOST_CRASHES: u32 = 40;

/// Numbers at the limits of what files may say.
const NUMBERS: &str = "0 -0 1 -1 2 3 7 127 128 255 256 32768 65535 65536 1000000 16777216 16777217 \
    2147483647 2147483648 4294967295 4294967296 -2147483648 9223372036854775807 18446744073709551615 \
    1e9 1e20 1e38 1e39 -1e38 1e-38 1e-45 1e309 nan inf";

/// A parser under test.
pub struct Target {
    /// Name, for `FENESTRA_FUZZ_TARGET`.
    pub name: &'static str,
    /// Name of the file that holds the input.
    pub file: &'static str,
    /// Files beside the input.
    pub beside: Vec<(&'static str, Vec<u8>)>,
    /// Sound inputs that mutations begin from.
    pub seeds: Vec<Vec<u8>>,
    /// Writes the input to its file before it is parsed; else the parser takes the bytes.
    pub is_file: bool,
    /// Mends checksums and lengths, so that mutations get past them.
    pub mend: fn(&mut Vec<u8>),
    /// Parses; true if the input is accepted.
    pub parse: fn(&Path, &[u8]) -> bool,
}

/// SplitMix64 generator (Steele, Lea and Flood 2014), started from a seed.
pub struct Random(pub u64);

impl Random {
    /// Starts the numbers of one case.
    pub fn new(target: &str, seed: u64, case: u64) -> Self {
        let name = target.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
            (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3)
        });
        let mut random = Self(name ^ seed.rotate_left(32));
        random.0 = random.bits() ^ case;
        random.bits();
        random
    }

    /// Draws 64 bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Draws an integer below `count`, 0 if that is 0.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count.max(1) as u64) as usize
    }

    fn range(&mut self, length: usize, longest: usize) -> Range<usize> {
        let start = self.below(length);
        start..(start + 1 + self.below(longest)).min(length)
    }
}

impl Target {
    /// A parser of files of their own, without mending.
    pub fn new(
        name: &'static str,
        file: &'static str,
        seeds: Vec<Vec<u8>>,
        parse: fn(&Path, &[u8]) -> bool,
    ) -> Self {
        let mend = |_: &mut Vec<u8>| ();
        Self { name, file, beside: Vec::new(), seeds, is_file: true, mend, parse }
    }

    /// Makes the input of a case; the same case gives the same bytes.
    pub fn input(&self, seed: u64, case: u64) -> Vec<u8> {
        let mut random = Random::new(self.name, seed, case);
        let mut bytes = self.seeds[random.below(self.seeds.len())].clone();
        let longest = bytes.len().max(1024) * LARGEST_GROWTH;
        let most = 1 << random.below(4);
        for _ in 0..1 + random.below(most) {
            let other = &self.seeds[random.below(self.seeds.len())];
            mutate(&mut bytes, other, &mut random);
            bytes.truncate(longest);
        }
        if random.below(8) > 0 {
            (self.mend)(&mut bytes);
        }
        bytes
    }
}

/// Ranges of the words of a text: runs of letters, digits, `_`, `.`, `+` and `-`.
fn words(bytes: &[u8]) -> Vec<Range<usize>> {
    let is_word = |byte: u8| byte.is_ascii_alphanumeric() || b"_.+-".contains(&byte);
    let mut words = Vec::new();
    let mut start = None;
    for (index, byte) in bytes.iter().enumerate() {
        match (start, is_word(*byte)) {
            (None, true) => start = Some(index),
            (Some(first), false) => {
                words.push(first..index);
                start = None;
            }
            _ => {}
        }
    }
    words.extend(start.map(|first| first..bytes.len()));
    words
}

fn is_number(word: &[u8]) -> bool {
    let digits = word.strip_prefix(b"-").unwrap_or(word);
    digits.first().is_some_and(|first| first.is_ascii_digit() || *first == b'.')
}

fn lines(bytes: &[u8]) -> Vec<Range<usize>> {
    let mut start = 0;
    let lines = bytes.split_inclusive(|byte| *byte == b'\n').map(|line| {
        start += line.len();
        start - line.len()..start
    });
    lines.collect()
}

/// Changes the input by one of several means, with parts of the sound input `other`.
fn mutate(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    if bytes.is_empty() {
        bytes.extend_from_slice(other);
        return;
    }
    match random.below(16) {
        0 => {
            let at = random.below(bytes.len());
            bytes[at] ^= 1 << random.below(8);
        }
        1 => {
            let at = random.below(bytes.len());
            bytes[at] = random.bits() as u8;
        }
        2 => bytes.truncate(random.below(bytes.len())),
        3 => {
            let removed = random.range(bytes.len(), 16);
            bytes.drain(removed);
        }
        4 => {
            let copied = bytes[random.range(bytes.len(), 64)].to_vec();
            let at = random.below(bytes.len());
            bytes.splice(at..at, copied);
        }
        5 => {
            let spliced = other[random.range(other.len(), 200)].to_vec();
            let replaced = random.range(bytes.len(), 200);
            bytes.splice(replaced, spliced);
        }
        6 | 7 => overwrite(bytes, random),
        8 => {
            let lines = lines(bytes);
            let line = lines[random.below(lines.len())].clone();
            let at = lines[random.below(lines.len())].start;
            match random.below(3) {
                0 => drop(bytes.drain(line)),
                1 => {
                    let line = bytes[line].to_vec();
                    bytes.splice(at..at, line);
                }
                _ => {
                    let lines = self::lines(other);
                    let line = other[lines[random.below(lines.len())].clone()].to_vec();
                    bytes.splice(at..at, line);
                }
            }
        }
        choice => {
            let mut words = words(bytes);
            if choice < 13 {
                words.retain(|word| is_number(&bytes[word.clone()]));
            }
            if words.is_empty() {
                return overwrite(bytes, random);
            }
            let word = words[random.below(words.len())].clone();
            let new = if choice < 13 {
                let numbers: Vec<&str> = NUMBERS.split(' ').collect();
                numbers[random.below(numbers.len())].into()
            } else if choice == 13 {
                Vec::new()
            } else {
                let from = if choice == 14 { other } else { &bytes[..] };
                let words = self::words(from);
                words
                    .get(random.below(words.len()))
                    .map_or(Vec::new(), |w| from[w.clone()].to_vec())
            };
            bytes.splice(word, new);
        }
    }
}

/// Overwrites one, two, four or eight bytes by a number at a limit.
fn overwrite(bytes: &mut [u8], random: &mut Random) {
    let limits = [0, 1, 2, 0x7f, 0x80, 0xff, 0xffff, 0x7fff_ffff, 0x8000_0000, 0xffff_ffff];
    let floats = [f32::NAN, f32::INFINITY, -1.0, f32::MAX, f32::MIN_POSITIVE, -0.0, 1e-45];
    let size = (1 << random.below(4)).min(bytes.len());
    let at = random.below(bytes.len() - size + 1);
    let mut value = match random.below(4) {
        0 => u64::from(floats[random.below(floats.len())].to_bits()),
        1 => u64::MAX >> random.below(64),
        2 => 1 << random.below(64),
        _ => limits[random.below(limits.len())],
    }
    .to_le_bytes();
    if random.below(4) == 0 {
        value[..size].reverse();
    }
    bytes[at..at + size].copy_from_slice(&value[..size]);
}

/// Reads a number from the environment.
fn setting(name: &str, otherwise: u64) -> u64 {
    env::var(name).map_or(otherwise, |text| text.parse().expect("a whole number"))
}

fn kept(target: &str, seed: u64, case: u64) -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fuzz-{target}-{seed}-{case}"))
}

/// Tries inputs until the time is over, as a process of its own: see [`run`].
fn work(target: &'static Target) {
    let [seed, first] = [setting("FENESTRA_FUZZ_SEED", 1), setting("FENESTRA_FUZZ_FIRST", 0)];
    let until = Instant::now() + Duration::from_secs_f64(seconds());
    memory::set_limit(ALLOWED_BYTES);
    let folder = PathBuf::from(env::var_os("FENESTRA_FUZZ_FOLDER").expect("a folder"));
    let path = folder.join(target.file);
    target.beside.iter().for_each(|(name, bytes)| fs::write(folder.join(name), bytes).unwrap());
    let progress = File::create(folder.join("progress")).unwrap();
    let current = Arc::new(AtomicU64::new(first));
    let watched = Arc::clone(&current);
    thread::spawn(move || {
        let (mut case, mut since) = (first, Instant::now());
        loop {
            thread::sleep(Duration::from_millis(200));
            let now = watched.load(Ordering::Relaxed);
            if now != case {
                (case, since) = (now, Instant::now());
            } else if since.elapsed() > TIME_LIMIT {
                eprintln!("no answer after {TIME_LIMIT:?}");
                process::exit(3);
            }
        }
    });
    let places = Arc::new(Mutex::new(String::new()));
    let place = Arc::clone(&places);
    panic::set_hook(Box::new(move |panicked| {
        let place = &mut *place.lock().unwrap();
        if place.is_empty() {
            *place = panicked.to_string().replace('\n', " ");
        }
    }));
    let mut found: BTreeMap<String, u64> = BTreeMap::new();
    let (mut case, mut accepted, mut slowest) = (first, 0_u64, Duration::ZERO);
    while Instant::now() < until {
        progress.write_all_at(&case.to_le_bytes(), 0).unwrap();
        current.store(case, Ordering::Relaxed);
        let input = target.input(seed, case);
        if target.is_file {
            fs::write(&path, &input).unwrap();
        }
        let started = Instant::now();
        match panic::catch_unwind(AssertUnwindSafe(|| (target.parse)(&path, &input))) {
            Ok(is_sound) => accepted += u64::from(is_sound),
            Err(_) => {
                let message = std::mem::take(&mut *places.lock().unwrap());
                found.entry(message).or_insert_with(|| {
                    fs::write(kept(target.name, seed, case), &input).unwrap();
                    case
                });
            }
        }
        slowest = slowest.max(started.elapsed());
        case += 1;
    }
    let mut report = format!("{} {accepted} {}\n", case - first, slowest.as_millis());
    found.iter().for_each(|(message, case)| report += &format!("case {case}: {message}\n"));
    fs::write(folder.join("report"), report).unwrap();
}

fn seconds() -> f64 {
    setting("FENESTRA_FUZZ_MILLISECONDS", 150) as f64 / 1000.0
}

/// Numbers of one target.
#[derive(Default)]
struct Outcome {
    /// Inputs tried.
    executions: u64,
    /// Inputs that the parser accepted.
    accepted: u64,
    /// Longest time of one input, ms.
    slowest_ms: u64,
    /// Failures, each with its case and the file that keeps its input.
    failures: Vec<String>,
}

/// Tries inputs of a target in a worker process with limited memory, and in another after each
/// crash.
fn run(target: &Target) -> Outcome {
    let seed = setting("FENESTRA_FUZZ_SEED", 1);
    let mut first = setting("FENESTRA_FUZZ_FIRST", 0);
    let mut outcome = Outcome::default();
    let mut left = seconds();
    for _ in 0..MOST_CRASHES {
        let folder = folder();
        let started = Instant::now();
        let mut worker = Command::new("sh");
        worker.args(["-c", "ulimit -v \"$1\"; ulimit -c 0; shift; exec \"$@\"", "sh"]);
        worker.arg(MEMORY_LIMIT_KIB.to_string()).arg(env::current_exe().unwrap());
        worker.args(["--exact", "fuzz::worker", "--nocapture"]);
        worker.env("FENESTRA_FUZZ_WORKER", target.name);
        worker.env("FENESTRA_FUZZ_FOLDER", folder.path());
        worker.env("FENESTRA_FUZZ_FIRST", first.to_string());
        worker.env("FENESTRA_FUZZ_MILLISECONDS", format!("{:.0}", left * 1000.0));
        worker.env("XDG_CACHE_HOME", folder.path()).env("RUST_LOG", "off");
        let output = worker.stdin(Stdio::null()).output().unwrap();
        if let Ok(report) = fs::read_to_string(folder.path().join("report")) {
            let (numbers, failures) = report.split_once('\n').unwrap();
            let mut numbers = numbers.split(' ').map(|number| number.parse::<u64>().unwrap());
            outcome.executions += numbers.next().unwrap();
            outcome.accepted += numbers.next().unwrap();
            outcome.slowest_ms = outcome.slowest_ms.max(numbers.next().unwrap());
            outcome.failures.extend(failures.lines().map(str::to_owned));
            break;
        }
        let progress = fs::read(folder.path().join("progress")).unwrap_or_default();
        let case = progress.try_into().map_or(first, u64::from_le_bytes);
        let input = kept(target.name, seed, case);
        File::create(&input).unwrap().write_all(&target.input(seed, case)).unwrap();
        let messages = String::from_utf8_lossy(&output.stderr).into_owned();
        let last = messages.lines().rev().find(|line| !line.trim().is_empty()).unwrap_or("");
        outcome.failures.push(format!("case {case}: {}: {last}", output.status));
        outcome.executions += case + 1 - first;
        first = case + 1;
        left -= started.elapsed().as_secs_f64();
        if left <= 0.0 {
            break;
        }
    }
    outcome
}

/// Makes a folder in memory where the system has such a disk.
fn folder() -> tempfile::TempDir {
    let memory = Path::new("/dev/shm");
    if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() }.unwrap()
}

/// Does the work of one target in a process that [`check`] starts, by the test `fuzz::worker`.
pub fn work_if_asked(targets: Vec<Target>) {
    let Ok(name) = env::var("FENESTRA_FUZZ_WORKER") else { return };
    let target = targets.into_iter().find(|target| target.name == name).unwrap();
    work(Box::leak(Box::new(target)));
}

/// Fails unless every seed is accepted.
pub fn check_seeds(targets: Vec<Target>) {
    let folder = tempfile::tempdir().unwrap();
    for target in targets {
        let folder = folder.path().join(target.name);
        fs::create_dir(&folder).unwrap();
        for (name, bytes) in &target.beside {
            fs::write(folder.join(name), bytes).unwrap();
        }
        for seed in &target.seeds {
            let mut bytes = seed.clone();
            (target.mend)(&mut bytes);
            let path = folder.join(target.file);
            fs::write(&path, &bytes).unwrap();
            // A MERL file is too large to be a seed: its head is.
            let is_sound = (target.parse)(&path, &bytes);
            assert!(is_sound || target.name == "merl", "{}", target.name);
        }
    }
}

/// Fails if a mutated file crashes, hangs or exhausts memory.
pub fn check(targets: Vec<Target>) {
    let wanted = env::var("FENESTRA_FUZZ_TARGET").ok();
    let mut failures = String::new();
    println!("{:<12}{:>12}{:>12}{:>12}", "target", "executions", "accepted", "longest ms");
    for target in targets {
        if wanted.as_ref().is_some_and(|name| name != target.name) {
            continue;
        }
        let outcome = run(&target);
        println!(
            "{:<12}{:>12}{:>12}{:>12}",
            target.name, outcome.executions, outcome.accepted, outcome.slowest_ms
        );
        for failure in outcome.failures {
            failures += &format!("{}: {failure}\n", target.name);
        }
    }
    assert!(
        failures.is_empty(),
        "the inputs lie in {} by target, seed and case:\n{failures}",
        env!("CARGO_TARGET_TMPDIR")
    );
}
