//! Values that flags choose by name: what help texts and completions offer, and what is read.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// One of these, by its name, with words on each for the help.
pub(super) fn one_of<T: Copy + Send + Sync + 'static>(
    all: impl IntoIterator<Item = T>,
    name: impl Fn(T) -> &'static str + Clone + Send + Sync + 'static,
    words: impl Fn(T) -> &'static str,
) -> impl TypedValueParser<Value = T> {
    let all: Vec<T> = all.into_iter().collect();
    let offered = all.iter().map(|&value| PossibleValue::new(name(value)).help(words(value)));
    PossibleValuesParser::new(offered).map(move |asked| {
        let named = all.iter().find(|&&value| name(value) == asked);
        *named.expect("one of those that are offered, and nothing else, comes through")
    })
}

/// The name of what is chosen by the program itself.
pub(super) const AUTO: &str = "auto";

/// A value, or none for what is chosen by the program itself.
#[derive(Clone, Copy, Debug)]
pub(super) struct OrAuto<T>(pub(super) Option<T>);

/// As [`one_of`], or [`AUTO`], with words on that as well.
pub(super) fn one_of_or_auto<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    name: fn(T) -> &'static str,
    words: fn(Option<T>) -> &'static str,
) -> impl TypedValueParser<Value = OrAuto<T>> {
    let all = [None].into_iter().chain(all.map(Some));
    one_of(all, move |value| value.map_or(AUTO, name), words).map(OrAuto)
}

#[cfg(test)]
mod tests {
    use clap::{Arg, Command};

    use super::*;
    use crate::render::Filter;
    use crate::scene::Integrator;

    fn parsed<P: TypedValueParser>(parser: P, value: &str) -> Result<P::Value, String>
    where
        P::Value: Clone + Send + Sync,
    {
        let command = Command::new("it").arg(Arg::new("value").value_parser(parser));
        let matches = command.try_get_matches_from(["it", value]).map_err(|error| error.to_string())?;
        Ok(matches.get_one::<P::Value>("value").expect("it is there").clone())
    }

    #[test]
    fn names_are_read_back() {
        let filters = || one_of(Filter::ALL, Filter::name, |_| "words");
        for filter in Filter::ALL {
            assert_eq!(parsed(filters(), filter.name()), Ok(filter));
        }
        let unknown = parsed(filters(), "lanczos").unwrap_err();
        assert!(unknown.contains("box, tent, gaussian, mitchell, blackman-harris"), "{unknown}");

        let integrators = || one_of_or_auto(Integrator::ALL, Integrator::name, |_| "words");
        for integrator in Integrator::ALL {
            assert_eq!(parsed(integrators(), integrator.name()).map(|it| it.0), Ok(Some(integrator)));
        }
        assert_eq!(parsed(integrators(), "auto").map(|it| it.0), Ok(None));
        assert!(parsed(integrators(), "bdpt").is_err());
    }
}
