//! The one place that reads the host's clock.

use messages::Time;

/// The host's monotonic clock.
pub fn monotonic() -> Time {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    Time::from_nanos(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64)
}

/// The time since the beginning of 1970 by the calendar of this machine, which may jump: for what people read, and never for what a robot does.
#[allow(clippy::disallowed_methods)]
pub fn since_1970() -> std::time::Duration {
    std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap_or_default()
}

/// Puts this thread to sleep. For tools and the launcher; a service waits through its node.
#[allow(clippy::disallowed_methods)]
pub fn sleep(duration: std::time::Duration) {
    std::thread::sleep(duration);
}
