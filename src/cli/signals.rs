//! Signals besides Ctrl-C's.
#![allow(unsafe_code, reason = "what is done when a signal comes, in the few calls that are allowed then")]

/// Has SIGTERM count as Ctrl-C.
pub(super) fn have_termination_interrupt() {
    // SAFETY: the handler calls nothing but what signal-safety(7) allows.
    unsafe { libc::signal(libc::SIGTERM, on_termination as *const () as libc::sighandler_t) };
}

/// Has the process end with a message and exit code 3 where a file that is mapped is cut short under it: of what lies
/// beyond its end there is nothing to give, and no read that could fail.
pub(super) fn tell_of_missing_pages() {
    // SAFETY: as above, and the structure's other fields are good as zeros.
    unsafe {
        let mut action: libc::sigaction = std::mem::zeroed();
        action.sa_sigaction = on_missing_page as *const () as libc::sighandler_t;
        action.sa_flags = libc::SA_SIGINFO;
        libc::sigaction(libc::SIGBUS, &raw const action, std::ptr::null_mut());
    }
}

extern "C" fn on_termination(_signal: libc::c_int) {
    // SAFETY: it may be called in a handler.
    unsafe { libc::raise(libc::SIGINT) };
}

extern "C" fn on_missing_page(signal: libc::c_int, info: *const libc::siginfo_t, _context: *const libc::c_void) {
    const MESSAGE: &str =
        "error: a file became shorter while it was read; wait until it is written, and run this again\n";
    // SAFETY: all of these may be called in a handler; the text is constant, and the system gives what the signal is
    // about.
    unsafe {
        if (*info).si_code != libc::BUS_ADRERR {
            // Memory that failed: by the signal, once the handler returns to where it happened.
            libc::signal(signal, libc::SIG_DFL);
            return;
        }
        libc::write(libc::STDERR_FILENO, MESSAGE.as_ptr().cast(), MESSAGE.len());
        libc::_exit(3);
    }
}
