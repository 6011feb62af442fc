"""What may be said of a result: verdicts, reporting rules, warnings, advice."""
