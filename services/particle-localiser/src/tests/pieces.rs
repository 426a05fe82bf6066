//! The pieces of the filter, each alone.

use crate::trigonometry::{sin_cos, wrap};

#[test]
fn sines_are_sines() {
    for step in -20_000..20_000 {
        let angle = step as f32 * 1e-3;
        let (sine, cosine) = sin_cos(angle);
        assert!((f64::from(sine) - f64::from(angle).sin()).abs() < 2e-6, "{angle}");
        assert!((f64::from(cosine) - f64::from(angle).cos()).abs() < 2e-6, "{angle}");
        assert!(
            (f64::from(wrap(angle)) - geometry::angle::wrap(f64::from(angle))).abs() < 1e-5
                || (wrap(angle).abs() - 3.14159).abs() < 1e-3
        );
    }
}
