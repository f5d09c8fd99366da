//! Stamps and positions of pictures, from a CSV file beside them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::error::PictureError;
use super::find::name_of;

/// Column with the names of the pictures.
const FILE: &str = "file";
/// Column with the time of each picture, seconds.
const STAMP: &str = "stamp_s";
/// Column with the position of the part, metres or radians.
const POSITION: &str = "position";
/// The latest time that fits into 64 bits of nanoseconds, seconds.
const MAX_SECONDS: i64 = i64::MAX / NS - 1;
const NS: i64 = 1_000_000_000;

/// A picture's row of the table.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Row {
    /// Time, nanoseconds. `None` without that column.
    pub(super) stamp_ns: Option<i64>,
    /// Position, metres or radians. `None` if the cell is empty, or without that column.
    pub(super) position: Option<f64>,
}

/// The table.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    /// The file.
    pub(super) path: PathBuf,
    /// Rows by the name of their picture.
    pub(super) rows: BTreeMap<String, Row>,
    /// True if it states stamps.
    pub(super) has_stamps: bool,
    /// True if it states positions.
    pub(super) has_positions: bool,
    /// Columns that are not read.
    ignored: Vec<String>,
}

/// Places of the columns.
struct Columns {
    file: usize,
    stamp: Option<usize>,
    position: Option<usize>,
}

impl Table {
    /// Reads a table.
    ///
    /// # Errors
    /// The file cannot be read, lacks a column, names a picture twice, or has a cell that is no number.
    pub(super) fn read(path: &Path) -> Result<Self, PictureError> {
        let io_error = |source| PictureError::Io { path: path.into(), source };
        let file = std::fs::File::open(path).map_err(io_error)?;
        let mut reader = csv::ReaderBuilder::new()
            .trim(csv::Trim::All)
            .comment(Some(b'#'))
            .flexible(true)
            .from_reader(file);
        let invalid =
            |line: u64, what: String| PictureError::Table { path: path.into(), line, what };
        let broken = |error: csv::Error| {
            let line = error.position().map_or(1, csv::Position::line);
            invalid(line, error.to_string())
        };
        let head = reader.headers().map_err(broken)?;
        let columns = Columns::of(head).map_err(|what| invalid(1, what))?;
        let is_read = |column: &&str| {
            [FILE, STAMP, POSITION].iter().any(|read| column.eq_ignore_ascii_case(read))
        };
        let ignored =
            head.iter().filter(|column| !is_read(column)).map(ToOwned::to_owned).collect();
        let mut rows = BTreeMap::new();
        for record in reader.records() {
            let record = record.map_err(broken)?;
            let line = record.position().map_or(0, csv::Position::line);
            let (name, row) = columns.row(&record).map_err(|what| invalid(line, what))?;
            if rows.insert(name.clone(), row).is_some() {
                return Err(invalid(line, format!("{name} is named twice")));
            }
        }
        if rows.is_empty() {
            return Err(invalid(2, "names no picture".to_owned()));
        }
        let (has_stamps, has_positions) = (columns.stamp.is_some(), columns.position.is_some());
        Ok(Self { path: path.into(), rows, has_stamps, has_positions, ignored })
    }

    /// Checks that a row names one of the pictures.
    ///
    /// # Errors
    /// None does.
    pub(super) fn check(&self, files: &[PathBuf]) -> Result<(), PictureError> {
        let is_named = |file: &PathBuf| {
            self.rows.contains_key(&name_of(file))
                || self.rows.contains_key(&*file.to_string_lossy())
        };
        let (Some(first), Some(row)) = (files.first(), self.rows.keys().next()) else {
            return Ok(());
        };
        if files.iter().any(is_named) {
            return Ok(());
        }
        let what = format!(
            "no row names one of the {} pictures: one names {row}, and the first picture is {}",
            files.len(),
            name_of(first)
        );
        Err(PictureError::Table { path: self.path.clone(), line: 2, what })
    }

    /// Returns a note about columns that are not read.
    pub(super) fn ignored_columns(&self) -> Option<String> {
        let (path, columns) = (self.path.display(), self.ignored.join(", "));
        (!self.ignored.is_empty()).then(|| {
            format!("{path}: these columns are not read: {columns}; read are {FILE}, {STAMP} and {POSITION}")
        })
    }
}

impl Columns {
    fn of(head: &csv::StringRecord) -> Result<Self, String> {
        let place = |name: &str| head.iter().position(|column| column.eq_ignore_ascii_case(name));
        let (file, stamp, position) = (place(FILE), place(STAMP), place(POSITION));
        match (file, stamp, position) {
            (Some(file), stamp, position) if stamp.is_some() || position.is_some() => {
                Ok(Self { file, stamp, position })
            }
            _ => Err(format!(
                "the first line names the columns {:?}; wanted are {FILE} and at least one of {STAMP} and {POSITION}, \
                 separated by commas",
                head.iter().collect::<Vec<_>>().join(",")
            )),
        }
    }

    fn row(&self, record: &csv::StringRecord) -> Result<(String, Row), String> {
        let cell = |column: usize| record.get(column).unwrap_or_default();
        let name = cell(self.file).to_owned();
        if name.is_empty() {
            return Err(format!("the column {FILE} is empty"));
        }
        let stamp_ns = self.stamp.map(|column| {
            let text = cell(column);
            nanoseconds(text).ok_or_else(|| format!("{STAMP} is {text:?}, not a time in seconds"))
        });
        let position = self.position.map(cell).filter(|text| !text.is_empty()).map(|text| {
            let number = text.parse().ok().filter(|position: &f64| position.is_finite());
            number.ok_or_else(|| format!("{POSITION} is {text:?}, not a number"))
        });
        Ok((name, Row { stamp_ns: stamp_ns.transpose()?, position: position.transpose()? }))
    }
}

/// Converts decimal seconds to nanoseconds exactly: times since the epoch do not fit into a float. Exponents are
/// accepted, but rounded.
fn nanoseconds(text: &str) -> Option<i64> {
    let (sign, digits) = match text.strip_prefix('-') {
        Some(digits) => (-1, digits),
        None => (1, text.strip_prefix('+').unwrap_or(text)),
    };
    let (whole, fraction) = digits.split_once('.').unwrap_or((digits, ""));
    let is_plain = (whole.len() + fraction.len()) > 0
        && whole.bytes().chain(fraction.bytes()).all(|byte| byte.is_ascii_digit());
    if !is_plain {
        let seconds: f64 = text.parse().ok()?;
        return (seconds.abs() <= MAX_SECONDS as f64).then(|| (seconds * NS as f64).round() as i64);
    }
    let whole: i64 = if whole.is_empty() { 0 } else { whole.parse().ok()? };
    let nine: String = fraction.chars().chain("000000000".chars()).take(9).collect();
    let nanoseconds: i64 = nine.parse().ok()?;
    (whole <= MAX_SECONDS).then(|| sign * (whole * NS + nanoseconds))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Table, String> {
        let place = tempfile::tempdir().unwrap();
        let path = place.path().join("p.csv");
        std::fs::write(&path, text).unwrap();
        Table::read(&path).map_err(|error| error.to_string())
    }

    #[test]
    fn columns_are_found_by_name() {
        let table = read(
            "# of the rig\nposition, File ,operator,stamp_s\n0.5,a.png,me,1.25\n,b.png,me,2\n",
        )
        .unwrap();
        assert!(table.has_stamps && table.has_positions);
        assert!(table.ignored_columns().unwrap().contains("are not read: operator;"));
        assert_eq!(table.rows["a.png"], Row { stamp_ns: Some(1_250_000_000), position: Some(0.5) });
        assert_eq!(table.rows["b.png"], Row { stamp_ns: Some(2_000_000_000), position: None });
        let table = read("\u{feff}file,stamp_s\r\n\"a, b.png\",7\r\n").unwrap();
        assert!(table.has_stamps && !table.has_positions);
        assert_eq!(table.ignored_columns(), None);
        assert_eq!(table.rows["a, b.png"].stamp_ns, Some(7_000_000_000));
    }

    #[test]
    fn faults_name_the_line() {
        for (text, line, what) in [
            ("a.png,1\n", 1, "wanted are file and"),
            ("file;stamp_s\na.png;1\n", 1, "separated by commas"),
            ("file,position\n\na.png,1\nb.png,one\n", 4, "position is \"one\""),
            ("file,position\na.png,inf\n", 2, "position is \"inf\""),
            ("file,stamp_s\na.png,\n", 2, "stamp_s is \"\""),
            ("file,stamp_s\na.png,1\nb.png,12:30\n", 3, "stamp_s is \"12:30\""),
            ("file,stamp_s\na.png,1\na.png,2\n", 3, "a.png is named twice"),
            ("file,stamp_s\n,1\n", 2, "the column file is empty"),
            ("file,stamp_s\n", 2, "names no picture"),
            ("", 1, "the first line"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.contains(&format!("line {line}: ")) && error.contains(what), "{error}");
        }
        assert!(
            Table::read(Path::new("/missing.csv"))
                .unwrap_err()
                .to_string()
                .contains("/missing.csv")
        );
    }

    #[test]
    fn seconds_are_exact() {
        assert_eq!(nanoseconds("1767225600.123456789"), Some(1_767_225_600_123_456_789));
        assert_eq!(nanoseconds("1767225600.1234567899"), Some(1_767_225_600_123_456_789));
        assert_eq!(
            [".5", "-0.5", "+3", "4."].map(nanoseconds).map(Option::unwrap),
            [500_000_000, -500_000_000, 3_000_000_000, 4_000_000_000]
        );
        assert_eq!(nanoseconds("2.5e-3"), Some(2_500_000));
        for text in ["", ".", "-", "nan", "inf", "1e300", "99999999999", "1 2"] {
            assert_eq!(nanoseconds(text), None, "{text}");
        }
    }
}
