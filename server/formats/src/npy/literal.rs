//! The header of a NumPy file: one Python dictionary of three known keys.

use crate::error::FormatError;

/// The fields of a header, types not yet interpreted.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Header {
    /// Text of the type, for example `<f4`; `None` for structured types, which are lists.
    pub(super) descr: Option<String>,
    pub(super) fortran_order: bool,
    pub(super) shape: Vec<i128>,
}

/// Parses `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4, 5), }`, keys in any order.
pub(super) fn parse(file: &str, text: &str) -> Result<Header, FormatError> {
    let mut rest = Rest(text.trim());
    let (mut descr, mut fortran_order, mut shape) = (None, None, None);
    let parsed = (|| {
        rest.take("{")?;
        while !rest.next_is("}") {
            let key = rest.string()?;
            rest.take(":")?;
            match key {
                "descr" if rest.next_is("[") => {
                    // What follows is refused whatever it is, so it needs no parsing.
                    descr = Some(None);
                    return Some(());
                }
                "descr" => descr = Some(Some(rest.string()?.to_owned())),
                "fortran_order" => fortran_order = Some(rest.boolean()?),
                "shape" => shape = Some(rest.tuple()?),
                _ => return None,
            }
            if !rest.next_is("}") {
                rest.take(",")?;
            }
        }
        Some(())
    })();
    let complete = match (parsed, descr) {
        (Some(()), Some(None)) => {
            return Ok(Header { descr: None, fortran_order: false, shape: Vec::new() });
        }
        (Some(()), Some(descr)) => {
            fortran_order.zip(shape).map(|(fortran_order, shape)| Header { descr, fortran_order, shape })
        }
        _ => None,
    };
    complete.ok_or_else(|| {
        let expected = "a dictionary with descr, fortran_order and shape";
        FormatError::field(file, "header", text.trim_end(), expected)
    })
}

/// What is left of the text.
struct Rest<'a>(&'a str);

impl<'a> Rest<'a> {
    fn next_is(&mut self, token: &str) -> bool {
        self.0 = self.0.trim_start();
        self.0.starts_with(token)
    }

    fn take(&mut self, token: &str) -> Option<()> {
        self.0 = self.0.trim_start().strip_prefix(token)?;
        Some(())
    }

    fn string(&mut self) -> Option<&'a str> {
        let quote = if self.next_is("'") { "'" } else { "\"" };
        self.take(quote)?;
        let (inside, rest) = self.0.split_once(quote)?;
        self.0 = rest;
        Some(inside)
    }

    fn boolean(&mut self) -> Option<bool> {
        match self.next_is("True") {
            true => self.take("True").map(|()| true),
            false => self.take("False").map(|()| false),
        }
    }

    fn tuple(&mut self) -> Option<Vec<i128>> {
        self.take("(")?;
        let (inside, rest) = self.0.split_once(')')?;
        self.0 = rest;
        let numbers = inside.trim().trim_end_matches(',');
        if numbers.is_empty() {
            return Some(Vec::new());
        }
        // Python 2 wrote long numbers with an `L`.
        numbers.split(',').map(|n| n.trim().trim_end_matches('L').parse().ok()).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_of_all_writers() {
        let expected = Header { descr: Some("<f4".into()), fortran_order: true, shape: vec![3, 4, 5] };
        for text in [
            "{'descr': '<f4', 'fortran_order': True, 'shape': (3, 4, 5), }   \n",
            "{\"shape\":(3L,4L,5L),\"fortran_order\":True,\"descr\":\"<f4\"}",
        ] {
            assert_eq!(parse("a.npy", text).unwrap(), expected, "{text}");
        }
        let short = parse("a.npy", "{'descr': '|u1', 'fortran_order': False, 'shape': (7,)}").unwrap();
        assert_eq!(short.shape, [7]);
        let empty = parse("a.npy", "{'descr': '|u1', 'fortran_order': False, 'shape': ()}").unwrap();
        assert!(empty.shape.is_empty());
    }

    #[test]
    fn other_texts_are_refused() {
        for text in [
            "",
            "{}",
            "{'descr': '<f4', 'fortran_order': True}",
            "{'descr': '<f4', 'fortran_order': 1, 'shape': (3,)}",
            "{'descr': '<f4', 'fortran_order': True, 'shape': (3, x)}",
            "{'descr': '<f4', 'fortran_order': True, 'shape': (3",
            "{'descr': '<f4' 'fortran_order': True, 'shape': (3,)}",
            "{'other': '<f4', 'fortran_order': True, 'shape': (3,)}",
        ] {
            assert!(parse("a.npy", text).is_err(), "{text}");
        }
    }
}
