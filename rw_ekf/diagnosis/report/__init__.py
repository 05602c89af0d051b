"""The diagnosis for people: text, tables, pictures, one page."""
