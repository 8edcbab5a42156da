//! `fenestra`: parse the command line, run the command, print the error chain, exit.

fn main() -> std::process::ExitCode {
    fenestra::cli::run(std::env::args_os().collect()).into()
}
