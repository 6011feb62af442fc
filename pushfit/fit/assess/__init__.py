"""What may be said of a result: verdicts, checks of the model, warnings, advice."""
