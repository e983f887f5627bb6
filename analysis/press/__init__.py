"""One recorded press: loading, drift, features, animation and sound."""
