//! WGSL rewritten as the worst conforming driver would compile it.
//!
//! - A product that feeds a sum is fused with it: `a * b + c` is rounded once, but for a double rounding in rare cases.
//! - A quotient is wrong by up to 2 units in its last place, as a hash of its operands says.
//! - Products and sums that pass `rounded` lose denormals.

/// Words that are followed by a type in angle brackets.
const GENERIC: [&str; 6] = ["vec2", "vec3", "vec4", "bitcast", "array", "atomic"];

const DIVIDE: &str = "
fn hostile_divide(a: f32, b: f32) -> f32 {
    let q = a / b;
    let hash = (bitcast<u32>(a) ^ (bitcast<u32>(b) * 2654435761u)) * 2246822519u;
    return select(bitcast<f32>(bitcast<u32>(q) + ((hash >> 16u) % 5u) - 2u), q, q == 0.0);
}
";

/// A kernel as it is shipped.
pub(super) fn hostile(kernel: &str, source: String) -> String {
    match kernel {
        "cast_closest" | "cover_voxels" => compiled(&flushing(&source)) + DIVIDE,
        _ => source,
    }
}

/// A kernel without `rounded` and with the device's own division.
pub(super) fn hostile_to_plain_arithmetic(kernel: &str, source: String) -> String {
    if !matches!(kernel, "cast_closest" | "cover_voxels") {
        return source;
    }
    let helpers_end = source.find("struct Uniforms").expect("the helpers stand first");
    let (helpers, rest) = source.split_at(helpers_end);
    let own =
        "fn divide(a: f32, b: f32) -> f32 {\n    if zero == 0u {\n        return a / b;\n    }";
    let helpers = replaced(helpers, "fn divide(a: f32, b: f32) -> f32 {", own);
    let rest = replaced(rest, "rounded3(", "(");
    let rest = rest.replace("rounded2(", "(").replace("rounded(", "(");
    let sum = "let product = (a * b);\n    return (product.x + product.y) + product.z;";
    let rest = replaced(&rest, sum, "return a.x * b.x + a.y * b.y + a.z * b.z;");
    compiled(&(helpers + &rest)) + DIVIDE
}

fn replaced(text: &str, from: &str, to: &str) -> String {
    assert!(text.contains(from), "the kernels changed, and this test has to: no `{from}`");
    text.replace(from, to)
}

/// `rounded` that flushes denormals to zero.
fn flushing(source: &str) -> String {
    let mut source = source.to_owned();
    for (float, word, zero, least) in [
        ("f32", "u32", "zero", "1.1754944e-38"),
        ("vec2<f32>", "vec2<u32>", "vec2(zero)", "vec2(1.1754944e-38)"),
        ("vec3<f32>", "vec3<u32>", "vec3(zero)", "vec3(1.1754944e-38)"),
    ] {
        let kept = format!("bitcast<{float}>(bitcast<{word}>(x) ^ {zero})");
        let flushed = format!("select({kept}, {float}(), abs(x) < {least})");
        source = replaced(&source, &format!("return {kept};"), &format!("return {flushed};"));
    }
    source
}

/// Products fused with sums, and quotients made wrong.
fn compiled(source: &str) -> String {
    let code: Vec<&str> =
        source.lines().map(|l| l.split("//").next().unwrap_or_default()).collect();
    let mut tokens = tokens(&code.join("\n"));
    while let Some((from, to, text)) = next_fused(&tokens) {
        tokens.splice(from..to, [text]);
    }
    while let Some(at) = tokens.iter().position(|token| token == "/") {
        let (from, to) = (start_of(&tokens, at), end_of(&tokens, at + 1));
        let (a, b) = (tokens[from..at].join(" "), tokens[at + 1..to].join(" "));
        tokens.splice(from..to, [format!("(hostile_divide({a}, {b}))")]);
    }
    tokens.join(" ")
}

/// Names with their members, numbers, operators and brackets.
fn tokens(code: &str) -> Vec<String> {
    let bytes = code.as_bytes();
    let (mut tokens, mut at) = (Vec::new(), 0);
    while at < bytes.len() {
        let from = at;
        let rest = &code[at..];
        let first = bytes[at] as char;
        let word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
        if first.is_whitespace() {
            at += 1;
            continue;
        } else if word(first) {
            at += rest.find(|c| !word(c)).unwrap_or(rest.len());
            // A negative exponent belongs to its number.
            let exponent = first.is_ascii_digit() && code[from..at].ends_with(['e', 'p']);
            if exponent && bytes[at] == b'-' {
                at += 1 + code[at + 1..].find(|c| !word(c)).unwrap_or(0);
            }
        } else {
            let pairs = [
                "<<", "<=", ">=", "==", "!=", "&&", "||", "+=", "-=", "*=", "->", "++", "--", "|=",
            ];
            let shift = rest.starts_with(">>") && bytes[at - 1] == b' ';
            at += if shift || pairs.iter().any(|pair| rest.starts_with(pair)) { 2 } else { 1 };
        }
        tokens.push(code[from..at].to_owned());
    }
    tokens
}

/// Whether an expression can end with a token.
fn ends(token: &str) -> bool {
    token.ends_with([')', ']'])
        || token.starts_with(|c: char| c.is_ascii_alphanumeric() || "_.".contains(c))
            && token != "return"
}

/// Whether the token is `+` or `-` between two operands.
fn is_sum(tokens: &[String], at: usize) -> bool {
    matches!(&tokens[at][..], "+" | "-") && ends(&tokens[at - 1])
}

/// The bracket that opens what the one at `at` closes.
fn opening(tokens: &[String], at: usize, open: &str) -> usize {
    let (close, mut depth, mut at) = (tokens[at].clone(), 0, at);
    loop {
        depth += i32::from(tokens[at] == close) - i32::from(tokens[at] == open);
        if depth == 0 {
            return at;
        }
        at -= 1;
    }
}

fn closing(tokens: &[String], at: usize, close: &str) -> usize {
    let (open, mut depth, mut at) = (tokens[at].clone(), 0, at);
    loop {
        depth += i32::from(tokens[at] == open) - i32::from(tokens[at] == close);
        if depth == 0 {
            return at;
        }
        at += 1;
    }
}

/// First token of the operand that ends before `end`.
fn start_of(tokens: &[String], end: usize) -> usize {
    let mut at = end - 1;
    loop {
        if tokens[at].starts_with('.') {
            at -= 1;
            continue;
        }
        match &tokens[at][..] {
            ")" => at = opening(tokens, at, "("),
            "]" => at = opening(tokens, at, "["),
            _ => break,
        }
        if tokens[at - 1] == ">" && tokens[at] == "(" {
            at = opening(tokens, at - 1, "<") - 1;
            break;
        }
        let called = tokens[at - 1].starts_with(|c: char| c.is_ascii_alphabetic());
        if !called || ["return", "if"].contains(&&tokens[at - 1][..]) {
            break;
        }
        at -= 1;
        break;
    }
    let unary = tokens[at - 1] == "-" && !ends(&tokens[at - 2]);
    at - usize::from(unary)
}

/// Token behind the operand that starts at `start`.
fn end_of(tokens: &[String], start: usize) -> usize {
    let mut at = start + usize::from(tokens[start] == "-");
    if tokens[at] == "(" {
        at = closing(tokens, at, ")");
    } else if GENERIC.contains(&&tokens[at][..]) && tokens[at + 1] == "<" {
        at = closing(tokens, at + 1, ">");
    }
    at += 1;
    loop {
        match &tokens[at][..] {
            "(" => at = closing(tokens, at, ")") + 1,
            "[" => at = closing(tokens, at, "]") + 1,
            member if member.starts_with('.') => at += 1,
            _ => return at,
        }
    }
}

/// The deepest product that feeds a sum: first token, token behind, and both as one.
fn next_fused(tokens: &[String]) -> Option<(usize, usize, String)> {
    let mut best: Option<(i32, (usize, usize, String))> = None;
    let mut depth = 0;
    for at in 0..tokens.len() {
        depth += i32::from(["(", "["].contains(&&tokens[at][..]));
        depth -= i32::from([")", "]"].contains(&&tokens[at][..]));
        if tokens[at] != "*"
            || !ends(&tokens[at - 1])
            || best.as_ref().is_some_and(|b| b.0 >= depth)
        {
            continue;
        }
        if let Some(found) = fused_at(tokens, at) {
            best = Some((depth, found));
        }
    }
    best.map(|(_, found)| found)
}

/// The sum that the product at `at` feeds, if any.
fn fused_at(tokens: &[String], at: usize) -> Option<(usize, usize, String)> {
    let to = end_of(tokens, at + 1);
    if ["*", "/", "%"].contains(&&tokens[to][..]) {
        return None;
    }
    let mut from = start_of(tokens, at);
    while ["*", "/", "%"].contains(&&tokens[from - 1][..]) {
        from = start_of(tokens, from - 1);
    }
    let text = |from: usize, to: usize| tokens[from..to].join(" ");
    let (a, b) = (text(from, at), text(at + 1, to));
    if is_sum(tokens, from - 1) {
        let sign = &tokens[from - 1];
        let mut first = start_of(tokens, from - 1);
        while ["*", "/", "%", "+"].contains(&&tokens[first - 1][..]) || is_sum(tokens, first - 1) {
            first = start_of(tokens, first - 1);
        }
        let a = if sign == "-" { format!("(0 - ({a}))") } else { a };
        return Some((first, to, fused(&a, &b, &text(first, from - 1))));
    }
    if !is_sum(tokens, to) {
        return None;
    }
    let mut end = end_of(tokens, to + 1);
    while ["*", "/", "%"].contains(&&tokens[end][..]) {
        end = end_of(tokens, end + 1);
    }
    let c = text(to + 1, end);
    let c = if tokens[to] == "-" { format!("(0 - ({c}))") } else { c };
    Some((from, end, fused(&a, &b, &c)))
}

/// a · b + c with the error of the product (Dekker 1971) and that of the sum (Knuth) added at the end. Both errors are 0
/// for integers, and the text means what it did.
fn fused(a: &str, b: &str, c: &str) -> String {
    let high = |x: &str| format!("(({x}) * 4097 - (({x}) * 4097 - ({x})))");
    let (ah, bh) = (high(a), high(b));
    let (al, bl) = (format!("(({a}) - {ah})"), format!("(({b}) - {bh})"));
    let product = format!("(({a}) * ({b}))");
    let of_product =
        format!("((({ah} * {bh} - {product}) + {ah} * {bl}) + {al} * {bh}) + {al} * {bl}");
    let sum = format!("({product} + ({c}))");
    let part = format!("({sum} - {product})");
    let of_sum = format!("(({product} - ({sum} - {part})) + (({c}) - {part}))");
    format!("({sum} + ({of_sum} + ({of_product})))")
}
