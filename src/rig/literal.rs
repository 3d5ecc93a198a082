//! Literals of Python, JSON among them: lists, dictionaries, texts, numbers, `True`, `None`.

use serde_json::{Map, Number, Value};

/// Deepest nesting that is read.
const MAX_DEPTH: usize = 64;

/// Reads the literal that `text` begins with; returns it and the text behind it, or the fault.
pub(super) fn literal(text: &str) -> Result<(Value, &str), String> {
    let mut reader = Reader { rest: text };
    let value = reader.value(0)?;
    Ok((value, reader.rest))
}

/// Text behind spaces and comments.
pub(super) fn skip_blank(mut text: &str) -> &str {
    loop {
        text = text.trim_start();
        match text.strip_prefix('#') {
            Some(comment) => text = comment.find('\n').map_or("", |end| &comment[end..]),
            None => return text,
        }
    }
}

struct Reader<'a> {
    rest: &'a str,
}

impl Reader<'_> {
    fn take(&mut self, token: char) -> bool {
        self.rest = skip_blank(self.rest);
        let found = self.rest.strip_prefix(token);
        self.rest = found.unwrap_or(self.rest);
        found.is_some()
    }

    fn fault<T>(&self, wanted: &str) -> Result<T, String> {
        let shown: String = self.rest.chars().take(24).take_while(|&c| c != '\n').collect();
        Err(format!("`{shown}` stands where {wanted} belongs"))
    }

    fn value(&mut self, depth: usize) -> Result<Value, String> {
        if depth > MAX_DEPTH {
            return Err(format!("it is nested more than {MAX_DEPTH} deep"));
        }
        self.rest = skip_blank(self.rest);
        match self.rest.chars().next() {
            Some('[') => self.list('[', ']', depth),
            Some('(') => self.list('(', ')', depth),
            Some('{') => self.dictionary(depth),
            Some('"' | '\'') => self.texts().map(Value::String),
            Some(c) if c.is_ascii_alphabetic() => self.word(),
            _ => self.number(),
        }
    }

    fn list(&mut self, open: char, close: char, depth: usize) -> Result<Value, String> {
        self.take(open);
        let mut items = Vec::new();
        while !self.take(close) {
            items.push(self.value(depth + 1)?);
            if !self.take(',') {
                if self.take(close) {
                    break;
                }
                return self.fault("a comma or the end of the list");
            }
        }
        Ok(Value::Array(items))
    }

    fn dictionary(&mut self, depth: usize) -> Result<Value, String> {
        self.take('{');
        let mut map = Map::new();
        while !self.take('}') {
            let Value::String(key) = self.value(depth + 1)? else {
                return self.fault("a key in quotes before it");
            };
            if !self.take(':') {
                return self.fault("a colon");
            }
            map.insert(key, self.value(depth + 1)?);
            if !self.take(',') {
                if self.take('}') {
                    break;
                }
                return self.fault("a comma or the end of the dictionary");
            }
        }
        Ok(Value::Object(map))
    }

    /// Texts that follow each other are one, as in Python.
    fn texts(&mut self) -> Result<String, String> {
        let mut text = self.text()?;
        loop {
            self.rest = skip_blank(self.rest);
            if !self.rest.starts_with(['"', '\'']) {
                return Ok(text);
            }
            text += &self.text()?;
        }
    }

    fn text(&mut self) -> Result<String, String> {
        let mut chars = self.rest.chars();
        let quote = chars.next();
        let mut text = String::new();
        loop {
            match chars.next() {
                None | Some('\n') => return self.fault("a text that ends on its line"),
                c if c == quote => break,
                Some('\\') => text.push(escaped(&mut chars).ok_or("an escape is not one of JSON")?),
                Some(c) => text.push(c),
            }
        }
        self.rest = chars.as_str();
        Ok(text)
    }

    fn word(&mut self) -> Result<Value, String> {
        let end = self.rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(self.rest.len());
        let value = match &self.rest[..end] {
            "True" | "true" => Value::Bool(true),
            "False" | "false" => Value::Bool(false),
            "None" | "null" => Value::Null,
            _ => return self.fault("a literal"),
        };
        self.rest = &self.rest[end..];
        Ok(value)
    }

    fn number(&mut self) -> Result<Value, String> {
        let of_number = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
        let end = self.rest.find(|c| !of_number(c)).unwrap_or(self.rest.len());
        let number = self.rest[..end].parse().ok().and_then(Number::from_f64);
        let Some(number) = number else { return self.fault("a literal") };
        self.rest = &self.rest[end..];
        Ok(Value::Number(number))
    }
}

/// The character of an escape, the backslash already read.
fn escaped(chars: &mut std::str::Chars) -> Option<char> {
    Some(match chars.next()? {
        'n' => '\n',
        't' => '\t',
        'r' => '\r',
        'b' => '\u{8}',
        'f' => '\u{c}',
        'u' => {
            let hex: String = chars.by_ref().take(4).collect();
            char::from_u32(u32::from_str_radix(&hex, 16).ok()?)?
        }
        c @ ('"' | '\'' | '\\' | '/') => c,
        _ => return None,
    })
}
