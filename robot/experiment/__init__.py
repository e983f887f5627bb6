"""From a planned press to a recorded session: plan, session, learning, setup."""
