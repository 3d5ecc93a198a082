//! Sixteen numbers at a time, in three ways with the same names.
//!
//! [`per_target`] compiles the functions of the walk once for each of them. Bounds may differ in their
//! last bits from way to way (reciprocals are estimates here and quotients there); a hit
//! is decided by operations that round alike everywhere.

#[cfg(target_arch = "x86_64")]
pub(super) mod avx2;
#[cfg(target_arch = "x86_64")]
pub(super) mod avx512;
pub(super) mod plain;

/// Numbers of a vector.
pub(super) const W: usize = 16;

/// The functions of a file for AVX-512, for AVX2, and for any machine, in modules of these names. `use
/// super::{…};` names the files whose functions they call.
macro_rules! per_target {
    (use $up:tt::{$($file:ident),*}; $($functions:tt)*) => {
        #[cfg(target_arch = "x86_64")]
        #[allow(unused_imports, clippy::needless_range_loop, clippy::too_many_arguments)]
        pub(in $up::$up) mod avx512 {
            use $up::*;
            use $up::$up::ops::avx512::*;
            $(use $up::$up::$file::avx512::*;)*
            per_target!(@avx512 $($functions)*);
        }
        #[cfg(target_arch = "x86_64")]
        #[allow(unused_imports, clippy::needless_range_loop, clippy::too_many_arguments)]
        pub(in $up::$up) mod avx2 {
            use $up::*;
            use $up::$up::ops::avx2::*;
            $(use $up::$up::$file::avx2::*;)*
            per_target!(@avx2 $($functions)*);
        }
        #[allow(unused_imports, clippy::needless_range_loop, clippy::too_many_arguments)]
        pub(in $up::$up) mod plain {
            use $up::*;
            use $up::$up::ops::plain::*;
            $(use $up::$up::$file::plain::*;)*
            per_target!(@plain $($functions)*);
        }
    };
    (@avx512 $($(#[$meta:meta])* fn $name:ident $args:tt $(-> $result:ty)? $body:block)*) => {
        $($(#[$meta])*
        #[inline]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
        pub(in crate::cast) fn $name $args $(-> $result)? $body)*
    };
    (@avx2 $($(#[$meta:meta])* fn $name:ident $args:tt $(-> $result:ty)? $body:block)*) => {
        $($(#[$meta])*
        #[inline]
        #[target_feature(enable = "avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
        pub(in crate::cast) fn $name $args $(-> $result)? $body)*
    };
    (@plain $($(#[$meta:meta])* fn $name:ident $args:tt $(-> $result:ty)? $body:block)*) => {
        $($(#[$meta])*
        #[inline]
        pub(in crate::cast) fn $name $args $(-> $result)? $body)*
    };
}
/// An array of three, without a closure: those are not always compiled into their caller.
macro_rules! three {
    ($k:ident => $number:expr) => {
        [
            {
                const $k: usize = 0;
                $number
            },
            {
                const $k: usize = 1;
                $number
            },
            {
                const $k: usize = 2;
                $number
            },
        ]
    };
}
pub(super) use per_target;
pub(in crate::cast) use three;
