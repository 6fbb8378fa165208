//! The program, run as a user runs it.

use std::process::{Child, Command, Output};

/// Runs it to its end.
pub fn twincast(args: &[&str]) -> Output {
    command().args(args).output().expect("the program runs")
}

/// It, for whoever has more to say than arguments.
pub fn command() -> Command {
    Command::new(env!("CARGO_BIN_EXE_twincast"))
}

/// What it said.
pub fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8")
}

/// A program that is ended when the test is, whatever becomes of it.
pub struct Running(Option<Child>);

impl Running {
    /// Of a program that was started.
    pub fn new(child: Child) -> Self {
        Self(Some(child))
    }

    /// At once, without a word.
    pub fn kill(&mut self) {
        if let Some(child) = &mut self.0 {
            let _ = child.kill();
        }
    }

    /// Of the process.
    pub fn id(&self) -> u32 {
        self.0.as_ref().expect("it runs").id()
    }

    /// Ctrl-C.
    #[cfg(unix)]
    pub fn interrupt(&self) {
        self.signal("INT");
    }

    /// By its name.
    #[cfg(unix)]
    pub fn signal(&self, name: &str) {
        // The shell's own: a system may have no other.
        let kill = format!("kill -{name} {}", self.id());
        assert!(Command::new("sh").args(["-c", &kill]).status().expect("a shell").success());
    }

    /// Exit code, none for a signal, and what it says on stderr.
    pub fn end(mut self) -> (Option<i32>, String) {
        let output = self.0.take().expect("it runs").wait_with_output().expect("it ends");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.kill();
        if let Some(mut child) = self.0.take() {
            let _ = child.wait();
        }
    }
}
