//! What may differ from record to record of one fit.

use crate::error::Error;

/// One value for all records of a fit, or one for each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct EachRecord<T> {
    first: T,
    others: Vec<T>,
}

impl<T> From<T> for EachRecord<T> {
    fn from(first: T) -> EachRecord<T> {
        EachRecord { first, others: Vec::new() }
    }
}

impl<T> EachRecord<T> {
    /// One for each record; a single one for all.
    ///
    /// # Errors
    /// [`Error::Spec`] where there is none of `what`.
    pub fn new(what: &str, values: Vec<T>) -> Result<EachRecord<T>, Error> {
        let mut values = values.into_iter();
        match values.next() {
            Some(first) => Ok(EachRecord { first, others: values.collect() }),
            None => {
                Err(Error::Spec(format!("fitting: no {what} was given; give one for all records")))
            }
        }
    }

    /// That of a record.
    pub fn of(&self, record: usize) -> &T {
        record.checked_sub(1).and_then(|k| self.others.get(k)).unwrap_or(&self.first)
    }

    /// All of them.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &T> {
        std::iter::once(&self.first).chain(&self.others)
    }

    /// Checks that there is one for all of so many records, or one for each.
    pub(crate) fn check(&self, what: &str, records: usize) -> Result<(), Error> {
        let given = 1 + self.others.len();
        if given == 1 || given == records {
            return Ok(());
        }
        Err(Error::Spec(format!(
            "fitting: {given} sets of {what} for {records} records; give one for all or one for each"
        )))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_is_that_of_all_records_and_several_are_counted() {
        let all = EachRecord::from(7);
        assert_eq!([*all.of(0), *all.of(5)], [7, 7]);
        assert!(all.check("numbers", 9).is_ok());
        let each = EachRecord::new("numbers", vec![1, 2]).unwrap();
        assert_eq!([*each.of(0), *each.of(1)], [1, 2]);
        assert!(each.check("numbers", 2).is_ok());
        let refused = each.check("numbers", 3).unwrap_err().to_string();
        assert!(refused.contains("2 sets of numbers for 3 records"), "{refused}");
        assert!(EachRecord::<u8>::new("numbers", vec![]).is_err());
    }
}
