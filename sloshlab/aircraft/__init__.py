"""Aircraft on which tanks slosh: finite-element decks, their modes, and models of modes, tanks and panels."""
