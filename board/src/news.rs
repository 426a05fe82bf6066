//! What is worth a line in the log of a service: that something has changed.

use messages::Time;
use std::time::Duration;

/// A service says no more than so much about one thing, however often it changes.
const PAUSE: Duration = Duration::from_secs(1);

/// Tells whether something has changed since it was last told, at most once a second: what changes to and fro
/// in between leaves no line.
#[derive(Debug, Clone, Default)]
pub struct News<T> {
    told: Option<(T, Time)>,
}

impl<T: PartialEq> News<T> {
    /// Nothing was told yet.
    pub const fn new() -> Self {
        Self { told: None }
    }

    /// Whether this is to be told now; it counts as told then.
    pub fn is_news(&mut self, now: Time, value: T) -> bool {
        let is_news = self.told.as_ref().is_none_or(|(told, at)| *told != value && now.since(*at) >= PAUSE);
        if is_news {
            self.told = Some((value, now));
        }
        is_news
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(values: &[(u64, char)]) -> String {
        let mut news = News::new();
        let at = |ms: u64| Time::from_nanos(ms * 1_000_000);
        values.iter().filter(|&&(ms, value)| news.is_news(at(ms), value)).map(|(_, value)| *value).collect()
    }

    #[test]
    fn changes_are_told_once_and_not_too_often() {
        assert_eq!(told(&[(0, 'a'), (1, 'a'), (2000, 'a')]), "a");
        assert_eq!(told(&[(0, 'a'), (1500, 'b'), (1600, 'a'), (2400, 'a'), (2500, 'a')]), "aba");
        assert_eq!(told(&[(0, 'a'), (500, 'b'), (700, 'a'), (1200, 'a')]), "a");
        assert_eq!(told(&[(0, 'a'), (500, 'b'), (999, 'b'), (1000, 'b')]), "ab");
    }
}
