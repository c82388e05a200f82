//! Function multiversioning for vectorised kernels.

/// Compiles a function twice, for the baseline instruction set and for AVX2, and picks one at run time. Operations and
/// their order are the same (the compiler never fuses products and sums), so results are the same to the bit. The body
/// must be `#[inline(always)]`.
macro_rules! multiversion {
    (
        $(#[$about:meta])*
        $seen:vis fn $name:ident = $body:path, ($($argument:ident: $kind:ty),* $(,)?) $(-> $out:ty)?
    ) => {
        $(#[$about])*
        $seen fn $name($($argument: $kind),*) $(-> $out)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn with_avx2($($argument: $kind),*) $(-> $out)? {
                    $body($($argument),*)
                }
                if std::arch::is_x86_feature_detected!("avx2") {
                    #[expect(unsafe_code, reason = "the one way to call what needs AVX2; the line above has asked for it")]
                    // SAFETY: this machine has AVX2.
                    return unsafe { with_avx2($($argument),*) };
                }
            }
            $body($($argument),*)
        }
    };
}
pub(crate) use multiversion;
