"""What recorded presses say of the bench's unknown numbers: a model that is fitted."""
