//! The command line: clap types, dispatch to the commands, exit status.

use std::{ffi::OsString, io::Write};

use clap::{ArgAction, CommandFactory, Parser, Subcommand};

use crate::{
    command::{
        self,
        options::{MACHINE, OUTPUT},
    },
    error::{Error, Result},
    memory,
    sampler::Parameters,
    terminal::{message, say},
};

/// Arguments of `fenestra`.
#[derive(Debug, Parser)]
#[command(name = "fenestra", version, about, propagate_version = true)]
pub(crate) struct Cli {
    /// Command to run.
    #[command(subcommand)]
    pub command: Command,
    /// Most memory to use, such as 512M or 8G. Default: three quarters of the machine's. A request
    /// beyond it is an error that says what asked for how much.
    #[arg(long, global = true, value_name = "SIZE", value_parser = memory::parse_size)]
    #[arg(help_heading = MACHINE, hide_short_help = true)]
    pub max_memory: Option<u64>,
    /// Log more: once what happens, twice details of the device too.
    #[arg(short, long, global = true, action = ArgAction::Count, help_heading = OUTPUT)]
    #[arg(hide_short_help = true)]
    pub verbose: u8,
}

/// The commands; each variant holds the arguments that `command/<name>.rs` declares.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Render a scene to an image.
    Render(Box<command::render::Arguments>),
    /// Show a scene in a window, with a camera that moves.
    View(Box<command::view::Arguments>),
    /// Compare samplers with a reference over scenes and seeds, in a report for the browser.
    Study(Box<command::study::Arguments>),
    /// Measure the error of an image against a reference, with thresholds for scripts.
    Compare(command::compare::Arguments),
    /// Make a picture or another image of a render: exposure, tone curve, part, layer.
    Convert(command::convert::Arguments),
    /// Combine renders of one scene made with different seeds or sample ranges.
    Merge(command::merge::Arguments),
    /// Measure how fast a scene's rays are traced, and where time and memory go.
    Bench(command::bench::Arguments),
    /// Describe and check a scene, image, environment map, BRDF or fit.
    Info(command::info::Arguments),
    /// Fit environment maps and BRDFs with spherical radial basis functions.
    Fit(command::fit::Arguments),
    /// Write a scene for another renderer.
    Export(command::export::Arguments),
    /// Write a first scene that renders as it is.
    New(command::new::Arguments),
    /// List the Vulkan devices with their relevant limits, and which one would be chosen.
    Devices(command::devices::Arguments),
    /// Print the script that completes commands and options in a shell.
    Completions(command::completions::Arguments),
    /// Write pages for `man`, one for each command.
    Manual(command::completions::ManualArguments),
    /// Test a device, in a process that its driver may crash.
    #[command(hide = true)]
    SelfTest(command::self_test::Arguments),
    /// Compile kernels for another process.
    #[command(hide = true)]
    Compile(command::compile::Arguments),
}

/// True if the arguments hold `--set help`, which needs no scene.
fn asks_for_parameters(arguments: &[OsString]) -> bool {
    arguments.iter().any(|argument| argument == "--set=help")
        || arguments.windows(2).any(|pair| pair[0] == "--set" && pair[1] == "help")
}

/// Parses the arguments, of which the first is the program's name, runs the command and prints the error
/// chain of a failure. Returns the exit status.
pub fn run(arguments: Vec<OsString>) -> u8 {
    if asks_for_parameters(&arguments) {
        // A closed output pipe is not an error.
        let _ = write!(std::io::stdout(), "{}", Parameters::help());
        return 0;
    }
    let cli = match Cli::try_parse_from(arguments) {
        Ok(cli) => cli,
        Err(error) => {
            // A closed output pipe is not an error.
            let _ = error.print();
            return u8::try_from(error.exit_code()).unwrap_or(2);
        }
    };
    let level = ["warn", "info", "debug"][usize::from(cli.verbose.min(2))];
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or(level))
        .format(|buffer, record| {
            let (level, style) = (record.level(), buffer.default_level_style(record.level()));
            writeln!(buffer, "[{style}{level:<5}{style:#}] {}", message(&record.args().to_string()))
        })
        .init();
    if let Some(bytes) = cli.max_memory {
        memory::set_limit(bytes);
    }
    command::compile::allow();
    // The pool, if any, lives until the command has ended.
    let result = command::start_threads().and_then(|_pool| match &cli.command {
        Command::Render(arguments) => command::render::run(arguments),
        Command::View(arguments) => command::view::run(arguments),
        Command::Study(arguments) => command::study::run(arguments),
        Command::Bench(arguments) => command::bench::run(arguments),
        Command::Compare(arguments) => command::compare::run(arguments),
        Command::Convert(arguments) => command::convert::run(arguments),
        Command::Info(arguments) => command::info::run(arguments),
        Command::Merge(arguments) => command::merge::run(arguments),
        Command::Fit(arguments) => command::fit::run(arguments),
        Command::Export(arguments) => command::export::run(arguments),
        Command::New(arguments) => command::new::run(arguments),
        Command::Devices(arguments) => command::devices::run(arguments),
        Command::Completions(arguments) => command::completions::run(arguments, Cli::command()),
        Command::Manual(arguments) => command::completions::manual(arguments, Cli::command()),
        Command::SelfTest(arguments) => command::self_test::run(arguments),
        Command::Compile(arguments) => command::compile::run(arguments),
    });
    match result {
        Ok(()) => 0,
        Err(error) => {
            let lines = explain(&error);
            say!("error: {}", lines[0]);
            lines[1..].iter().for_each(|line| say!("{line}"));
            error.exit_status()
        }
    }
}

/// Parses a command of which the first argument is the program's name, for a program in its place.
///
/// # Errors
/// [`Error::Usage`] with the first paragraph of the message.
pub fn parse(arguments: &[String]) -> Result<Command> {
    Cli::try_parse_from(arguments).map(|cli| cli.command).map_err(|error| {
        let text = error.to_string();
        let message = text.split("\n\n").next().unwrap_or_default();
        Error::usage(message.trim_start_matches("error: "))
    })
}

/// Lines on an error, its causes and, if known, the remedy; never empty.
pub fn explain(error: &Error) -> Vec<String> {
    let mut lines = vec![error.to_string()];
    let mut source = std::error::Error::source(error);
    // `Io` already prints its source in its own line.
    while let Some(cause) = source.filter(|_| !matches!(error, Error::Io { .. })) {
        lines.push(format!("  caused by: {cause}"));
        source = cause.source();
    }
    let help = match error {
        Error::Device { help, .. } => Some(help.as_str()),
        Error::Memory { help, .. } | Error::Denoiser { help, .. } => *help,
        _ => None,
    };
    lines.extend(help.map(|help| format!("help: {help}")));
    lines
}
