"""One recorded press: features, replay, strings and sound."""
