//! What rays have hit: noted by number while they travel ([`found`]), or listed for whoever decides by other corners
//! ([`listed`]), told apart where surfaces lie on each other ([`coplanar`]), and computed several at a time in the end
//! ([`noted`], [`quad`]).

pub(super) mod coplanar;
pub(super) mod found;
pub(super) mod listed;
pub(super) mod noted;
pub(super) mod quad;
