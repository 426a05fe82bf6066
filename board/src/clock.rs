//! The one place that reads the host's clock.

use messages::Time;

/// The host's monotonic clock.
pub fn monotonic() -> Time {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    Time::from_nanos(now.tv_sec as u64 * 1_000_000_000 + now.tv_nsec as u64)
}

/// Puts this thread to sleep. For tools and the launcher; a service waits through its node.
#[allow(clippy::disallowed_methods)]
pub fn sleep(duration: std::time::Duration) {
    std::thread::sleep(duration);
}
