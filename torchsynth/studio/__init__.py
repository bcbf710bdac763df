"""The studio: a page in the browser on which textures are made."""
