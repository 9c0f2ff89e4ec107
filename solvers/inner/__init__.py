"""Back ends for the inner problem: the QVI with the friction bound given."""
