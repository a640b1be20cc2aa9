//! Prims and properties that are to be written.

use std::borrow::Cow;

/// Something that is defined, with all that lies below it.
#[derive(Default)]
pub(super) struct Prim {
    pub(super) name: String,
    pub(super) type_name: &'static str,
    /// Whether it says of what material it is.
    pub(super) is_bound: bool,
    pub(super) properties: Vec<Property>,
    pub(super) children: Vec<Prim>,
}

/// An attribute, or a relationship where it has no type.
pub(super) struct Property {
    pub(super) name: String,
    pub(super) type_name: Cow<'static, str>,
    pub(super) is_uniform: bool,
    pub(super) fields: Vec<(&'static str, Said)>,
    /// The path to which it leads.
    pub(super) target: Option<String>,
}

/// What a field says.
pub(super) enum Said {
    Value(u64),
    Token(String),
}

impl Property {
    pub(super) fn new(type_name: impl Into<Cow<'static, str>>, name: impl Into<String>) -> Self {
        Self { name: name.into(), type_name: type_name.into(), is_uniform: false, fields: Vec::new(), target: None }
    }

    /// A token that does not change.
    pub(super) fn fixed(name: impl Into<String>, token: impl Into<String>) -> Self {
        Self::new("token", name).uniform().token(token)
    }

    /// A relationship to what has this path.
    pub(super) fn to(name: &str, path: String) -> Self {
        Self::new("", name).uniform().from(path)
    }

    pub(super) fn is_called(&self, name: &str) -> bool {
        self.name == name
    }

    pub(super) fn is_relationship(&self) -> bool {
        self.type_name.is_empty()
    }

    pub(super) fn uniform(self) -> Self {
        Self { is_uniform: true, ..self }
    }

    pub(super) fn value(self, value: u64) -> Self {
        self.with("default", Said::Value(value))
    }

    pub(super) fn token(self, token: impl Into<String>) -> Self {
        self.with("default", Said::Token(token.into()))
    }

    pub(super) fn samples(self, samples: u64) -> Self {
        self.with("timeSamples", Said::Value(samples))
    }

    /// What its elements belong to, such as corners.
    pub(super) fn by(self, interpolation: &str) -> Self {
        self.with("interpolation", Said::Token(interpolation.to_owned()))
    }

    /// It has the value of the attribute of this path.
    pub(super) fn from(self, path: String) -> Self {
        Self { target: Some(path), ..self }
    }

    fn with(mut self, field: &'static str, said: Said) -> Self {
        self.fields.push((field, said));
        self
    }
}
