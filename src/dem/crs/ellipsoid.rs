//! Size and shape of a planet.

/// An ellipsoid of revolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ellipsoid {
    /// Equatorial radius, metres.
    pub(crate) semi_major: f64,
    /// (a - b) / a, at least 0 and below 1.
    pub(crate) flattening: f64,
}

impl Ellipsoid {
    /// The Earth's, as GPS has it.
    pub(crate) const WGS84: Self = Self { semi_major: 6_378_137.0, flattening: 1.0 / 298.257_223_563 };

    /// Metres in a degree of longitude and of latitude, at `latitude` degrees: N cos(latitude) and the meridional radius M
    /// (Snyder 1987, *Map Projections*, eq. 4-18 and 4-20).
    #[must_use]
    pub(crate) fn metres_per_degree(self, latitude: f64) -> (f64, f64) {
        let (sin, cos) = latitude.to_radians().sin_cos();
        let (e2, prime_vertical) = self.prime_vertical(sin);
        let meridional = prime_vertical * (1.0 - e2) / (1.0 - e2 * sin * sin);
        let degree = 1f64.to_radians();
        (prime_vertical * cos * degree, meridional * degree)
    }

    /// The point of the surface at a longitude and a latitude in degrees, in metres from the centre.
    #[must_use]
    pub(super) fn point(self, longitude: f64, latitude: f64) -> [f64; 3] {
        let ((sin, cos), (east, north)) = (latitude.to_radians().sin_cos(), longitude.to_radians().sin_cos());
        let (e2, n) = self.prime_vertical(sin);
        [n * cos * north, n * cos * east, n * (1.0 - e2) * sin]
    }

    /// The square of the eccentricity, and the radius of curvature across the meridian.
    fn prime_vertical(self, sin: f64) -> (f64, f64) {
        let e2 = self.flattening * (2.0 - self.flattening);
        (e2, self.semi_major / (1.0 - e2 * sin * sin).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn degrees_on_the_ellipsoid() {
        // Geodesics on WGS 84 by PROJ (tests/oracle/terrain_files.py), metres.
        for (latitude, east, north) in [
            (0.0, 111_319.491, 110_574.276),
            (36.5, 89_591.101, 110_968.296),
            (80.0, 19_393.486, 111_659.940),
        ] {
            let (x, y) = Ellipsoid::WGS84.metres_per_degree(latitude);
            assert_relative_eq!(x, east, epsilon = 0.002);
            assert_relative_eq!(y, north, epsilon = 0.002);
        }
    }
}
