//! Why a condition cannot be.

/// Why a condition cannot be.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ConditionError {
    /// There is no condition of that name.
    #[error(
        "there is no condition `{name}`; known are fog, wet, snow, rain, blur, crosstalk and echo"
    )]
    UnknownCondition {
        /// Text as written.
        name: String,
    },
    /// A part that is no pair.
    #[error("`{part}` in the condition `{text}` is no KEY=VALUE; {condition} takes {known}")]
    NoPair {
        /// The part.
        part: String,
        /// All that was written.
        text: String,
        /// The condition's name.
        condition: &'static str,
        /// Its keys in words.
        known: String,
    },
    /// A key that the condition does not have.
    #[error("{condition} has no key `{key}`; it takes {known}{hint}")]
    UnknownKey {
        /// Text as written.
        key: String,
        /// The condition's name.
        condition: &'static str,
        /// Its keys in words.
        known: String,
        /// Where to go instead; empty where nothing is known.
        hint: &'static str,
    },
    /// A key given more than once.
    #[error("the condition `{text}` gives `{key}` twice; give it once")]
    RepeatedKey {
        /// The key.
        key: String,
        /// All that was written.
        text: String,
    },
    /// A word that is no level.
    #[error("`level={value}` of {condition}: `{value}` is not one of {known}")]
    UnknownLevel {
        /// Text as written.
        value: String,
        /// The condition's name.
        condition: &'static str,
        /// The levels in words.
        known: String,
    },
    /// A value that is no number or outside of its limits.
    #[error("`{key}={value}` of {condition}: wanted is a number from {least} to {most}{unit}")]
    BadNumber {
        /// The key.
        key: &'static str,
        /// Text as written.
        value: String,
        /// The condition's name.
        condition: &'static str,
        /// Least value.
        least: String,
        /// Greatest value.
        most: String,
        /// Unit with a space before it.
        unit: &'static str,
    },
    /// A condition given twice.
    #[error("the condition {condition} is given twice; give it once")]
    Repeated {
        /// The condition's name.
        condition: &'static str,
    },
}
