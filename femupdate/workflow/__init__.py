"""The steps that the commands take, each a function from a study to a study."""
