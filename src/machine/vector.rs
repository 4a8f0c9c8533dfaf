//! Which vector instructions the kernels of this crate use: the widest of the processor, or what the environment says.
//!
//! Every kernel that is compiled for several instruction sets (convolution, message passing, patch search, losses) asks
//! [`arch`] here. Levels differ in the last bits of their sums. candle's own matrix product has its own choice, which this one
//! does not touch; no training of ours calls it in a loop.

use crate::error::{Error, Result};
use pulp::Arch;
use std::sync::LazyLock;

/// The environment variable that names the level.
pub(crate) const VECTOR_VARIABLE: &str = "MONADNOCK_VECTOR";

/// Vector instructions, from the narrowest to the widest.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum VectorLevel {
    /// One number at a time, as far as the compiler does no better with the build's baseline (SSE2 on x86-64).
    Scalar,
    /// Eight `f32` at a time with fused multiply-add.
    Avx2,
    /// Sixteen `f32` at a time.
    Avx512,
    /// What processors other than x86-64 offer (NEON on aarch64).
    Native,
}

impl VectorLevel {
    /// All of them.
    pub(crate) const ALL: [Self; 4] = [Self::Scalar, Self::Avx2, Self::Avx512, Self::Native];

    /// The level as [`VECTOR_VARIABLE`] names it.
    #[must_use]
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Native => "native",
        }
    }

    /// The level that [`VECTOR_VARIABLE`] asks for, read once; the widest of this processor when it is not set.
    ///
    /// # Errors
    /// When the variable names no level, or one that this processor does not have. The kernels then use the widest.
    pub(crate) fn chosen() -> Result<Self> {
        let (level, _) = *CHOSEN;
        level.ok_or_else(|| {
            let value = std::env::var_os(VECTOR_VARIABLE).unwrap_or_default();
            let names: Vec<&str> =
                Self::ALL.into_iter().filter(|l| l.arch().is_some()).map(Self::name).collect();
            let allowed = format!("allowed on this processor: {}", names.join(", "));
            Error::value(VECTOR_VARIABLE, format!("{value:?}"), allowed)
        })
    }

    /// What kernels of this level are dispatched on; `None` on a processor without it.
    fn arch(self) -> Option<Arch> {
        match self {
            Self::Scalar => Some(Arch::Scalar),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => pulp::x86::V3::try_new().map(Arch::V3),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => pulp::x86::V4::try_new().map(Arch::V4),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Native => Some(Arch::new()).filter(|arch| !matches!(arch, Arch::Scalar)),
            _ => None,
        }
    }

    /// The level of a name; without one, the widest of this processor.
    fn find(name: Option<&str>) -> Option<(Self, Arch)> {
        let there = |level: Self| level.arch().map(|arch| (level, arch));
        match name {
            Some(name) => Self::ALL.into_iter().find(|level| level.name() == name).and_then(there),
            None => Self::ALL.into_iter().rev().find_map(there),
        }
    }
}

/// The level that was asked for, where it is there, and what is used.
static CHOSEN: LazyLock<(Option<VectorLevel>, Arch)> = LazyLock::new(|| {
    let asked = std::env::var_os(VECTOR_VARIABLE).map(|name| name.to_string_lossy().into_owned());
    match VectorLevel::find(asked.as_deref()) {
        Some((level, arch)) => (Some(level), arch),
        None => (None, Arch::new()),
    }
});

/// What every kernel is dispatched on.
#[must_use]
pub(crate) fn arch() -> Arch {
    CHOSEN.1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails where the variable asks for what is not there, so that no run of the tests is at another level than it says.
    #[test]
    fn the_level_asked_for_is_in_use() {
        let level = VectorLevel::chosen().unwrap();
        if let Ok(asked) = std::env::var(VECTOR_VARIABLE) {
            assert_eq!(level.name(), asked);
        }
        assert_eq!(format!("{:?}", arch()), format!("{:?}", level.arch().unwrap()));
    }

    #[test]
    fn names_find_their_levels() {
        assert_eq!(VectorLevel::find(Some("scalar")).unwrap().0, VectorLevel::Scalar);
        assert!(["", "Scalar", "avx1024"].into_iter().all(|name| VectorLevel::find(Some(name)).is_none()));
        let widest = VectorLevel::find(None).unwrap().0;
        for level in VectorLevel::ALL {
            let found = VectorLevel::find(Some(level.name()));
            assert_eq!(found.is_some(), level.arch().is_some(), "{level:?}");
        }
        assert_eq!(format!("{:?}", widest.arch().unwrap()), format!("{:?}", Arch::new()));
    }
}
