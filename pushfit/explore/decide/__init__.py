"""What a push would tell, and whether there is an answer."""
