"""The participant's texts in the language of a study: what a text is in it, and how it writes numbers."""
