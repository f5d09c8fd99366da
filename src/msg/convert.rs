//! Between messages and the scanner's types.
