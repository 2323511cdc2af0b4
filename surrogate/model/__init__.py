"""A trained model: store, train, predict, evaluate."""
