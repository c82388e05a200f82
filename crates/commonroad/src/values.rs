//! Numbers in the text of a document, as Python reads and writes them: other readers of the format are in Python.

/// Zeros of the decimal digits of Unicode beyond ASCII in the basic plane; nine more digits follow each.
const ZEROS: [u32; 36] = [
    0x660, 0x6F0, 0x7C0, 0x966, 0x9E6, 0xA66, 0xAE6, 0xB66, 0xBE6, 0xC66, 0xCE6, 0xD66, 0xDE6, 0xE50, 0xED0, 0xF20,
    0x1040, 0x1090, 0x17E0, 0x1810, 0x1946, 0x19D0, 0x1A80, 0x1A90, 0x1B50, 0x1BB0, 0x1C40, 0x1C50, 0xA620, 0xA8D0,
    0xA900, 0xA9D0, 0xA9F0, 0xAA50, 0xABF0, 0xFF10,
];
/// Whole numbers beyond this are of more than 30 digits, and none of them is in bounds.
const BEYOND: i128 = 10_i128.pow(30);
/// Python refuses to read whole numbers of more digits.
const MOST_DIGITS: usize = 4300;

/// A number; `None`: the text is none.
pub fn real(text: &str) -> Option<f64> {
    let plain = text.trim();
    if plain.bytes().all(|byte| byte.is_ascii_digit() || matches!(byte, b'.' | b'-' | b'+' | b'e' | b'E')) {
        return plain.parse().ok();
    }
    without_underscores(&ascii_digits(plain))?.parse().ok()
}

/// A whole number; those of more than 30 digits are cut. `None`: the text is none.
pub fn whole(text: &str) -> Option<i128> {
    let plain = text.trim();
    let digits = without_underscores(&ascii_digits(plain))?;
    let (sign, digits) = match digits.strip_prefix(['-', '+']) {
        Some(rest) => (if digits.starts_with('-') { -1 } else { 1 }, rest),
        None => (1, digits.as_str()),
    };
    if digits.is_empty() || digits.len() > MOST_DIGITS || !digits.bytes().all(|byte| byte.is_ascii_digit()) {
        return None;
    }
    let significant = digits.trim_start_matches('0');
    let size = if significant.len() > 30 { BEYOND } else { significant.parse().unwrap_or(0) };
    Some(sign * size)
}

/// A whole number in words of messages.
pub fn shown(number: i128) -> String {
    if number.abs() < BEYOND { number.to_string() } else { "of more than 30 digits".to_string() }
}

/// Every decimal digit as one of ASCII.
fn ascii_digits(text: &str) -> String {
    let ascii = |sign: char| {
        let code = sign as u32;
        let zero = ZEROS.iter().find(|&&zero| (zero..zero + 10).contains(&code));
        zero.and_then(|zero| char::from_digit(code - zero, 10)).unwrap_or(sign)
    };
    text.chars().map(ascii).collect()
}

/// Underscores may separate digits; `None`: one is elsewhere.
fn without_underscores(text: &str) -> Option<String> {
    let bytes = text.as_bytes();
    let separates = |at: usize| {
        at > 0 && bytes[at - 1].is_ascii_digit() && bytes.get(at + 1).is_some_and(|byte| byte.is_ascii_digit())
    };
    let all_separate = bytes.iter().enumerate().all(|(at, &byte)| byte != b'_' || separates(at));
    all_separate.then(|| text.replace('_', ""))
}

/// A number with six significant digits, as messages show it: `0.001`, `1e+09`.
pub fn general(value: f64) -> String {
    if !value.is_finite() {
        return if value.is_nan() {
            "nan".into()
        } else if value > 0.0 {
            "inf".into()
        } else {
            "-inf".into()
        };
    }
    let scientific = format!("{value:.5e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let short = |digits: &str| match digits.contains('.') {
        true => digits.trim_end_matches('0').trim_end_matches('.').to_string(),
        false => digits.to_string(),
    };
    if (-4..6).contains(&exponent) {
        return short(&format!("{value:.*}", usize::try_from(5 - exponent).unwrap_or(0)));
    }
    let sign = if exponent < 0 { '-' } else { '+' };
    format!("{}e{sign}{:02}", short(mantissa), exponent.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_read_as_python_reads_them() {
        for (text, value) in [
            ("1.5", 1.5),
            (" 5 ", 5.0),
            ("1_000", 1000.0),
            ("٣", 3.0),
            ("+7", 7.0),
            ("1.", 1.0),
            (".5", 0.5),
            ("1e3", 1e3),
        ] {
            assert_eq!(real(text), Some(value), "{text}");
        }
        assert!(real("NaN").is_some_and(f64::is_nan));
        assert_eq!(real("-Infinity"), Some(f64::NEG_INFINITY));
        for text in ["", "0x10", "1,5", "1e", "--1", "1.0.0", "_1", "1_", "1__0", "1 2", "."] {
            assert_eq!(real(text), None, "{text}");
        }
    }

    #[test]
    fn whole_numbers_have_no_point_and_may_be_long() {
        assert_eq!(whole(" -12 "), Some(-12));
        assert_eq!(whole("1_0"), Some(10));
        assert_eq!(whole("5.0"), None);
        assert_eq!(whole(""), None);
        assert_eq!(whole("-"), None);
        assert_eq!(shown(whole(&"9".repeat(40)).unwrap_or(0)), "of more than 30 digits");
        assert_eq!(whole(&"9".repeat(5000)), None);
    }

    #[test]
    fn numbers_are_shown_with_six_digits() {
        for (value, text) in [
            (1e9, "1e+09"),
            (1000.0, "1000"),
            (0.001, "0.001"),
            (0.000_012_345_67, "1.23457e-05"),
            (9_007_199_254_740_991.0, "9.0072e+15"),
            (-1234.5678, "-1234.57"),
            (0.0, "0"),
            (999_999.6, "1e+06"),
        ] {
            assert_eq!(general(value), text);
        }
    }
}
