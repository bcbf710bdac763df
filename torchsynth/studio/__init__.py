"""The studio: a page in the browser that does what the library does, and shows how it comes about.

``torchsynth studio`` starts it, and so does :func:`torchsynth.studio.server.launch`. It needs gradio, the extra
``studio``. What one visitor has is kept in one :class:`torchsynth.studio.visitor.Visitor`; the page asks no
other machine for anything.
"""
