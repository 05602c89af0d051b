"""What is reported of a record: probabilities, words, the document."""
