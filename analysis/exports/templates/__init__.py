"""Parts of exported files that are the same for every database.

Modules here are copied into folders that programs without Traction read; `text` adds
where they come from.
"""
