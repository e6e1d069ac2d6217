"""The documentation: pages in Markdown, and the reference that is made from the code."""
