//! Signals besides Ctrl-C's.
#![allow(unsafe_code, reason = "what is done when a signal comes, in the few calls that are allowed then")]

/// Has SIGTERM count as Ctrl-C.
pub(super) fn have_termination_interrupt() {
    // SAFETY: the handler calls nothing but what signal-safety(7) allows.
    unsafe { libc::signal(libc::SIGTERM, on_termination as *const () as libc::sighandler_t) };
}

/// Has the process end with a message and exit code 3 where a file that is mapped is cut short under it: of what lies beyond its end there is nothing to give, and no
/// read that could fail.
pub(super) fn tell_of_missing_pages() {
    // SAFETY: as above.
    unsafe { libc::signal(libc::SIGBUS, on_missing_page as *const () as libc::sighandler_t) };
}

extern "C" fn on_termination(_signal: libc::c_int) {
    // SAFETY: it may be called in a handler.
    unsafe { libc::raise(libc::SIGINT) };
}

extern "C" fn on_missing_page(_signal: libc::c_int) {
    const MESSAGE: &str =
        "error: a file became shorter while it was read; wait until it is written, and run this again\n";
    // SAFETY: both may be called in a handler; the text is constant.
    unsafe {
        libc::write(libc::STDERR_FILENO, MESSAGE.as_ptr().cast(), MESSAGE.len());
        libc::_exit(3);
    }
}
