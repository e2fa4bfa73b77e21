"""The scaling law (2.33–2.35) put to the test: the numerical tank at several sizes in similarity."""
