"""The report page: sections, tables, figures in order, what-if variants.

`page` writes the folder, `page_model` is what a page consists of, `gallery` collects
the figures. Begin with `page`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
