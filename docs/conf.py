"""Sphinx configuration of the report; `make site` lays out the sources and calls Sphinx."""

from pathlib import Path

from sphinx.ext import autosummary

from replication.site.reference import source_of

project = "Unified IRL, replicated"
copyright = "the replication authors, MIT licence"
language = "en"

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx.ext.linkcode",
    "replication.site.extension",
]
exclude_patterns = ["figures", "replication", "data", "source"]
templates_path = [str(Path(__file__).parent / "_templates")]  # the sources are laid out elsewhere
autosummary.WELL_KNOWN_ABBREVIATIONS += (  # type: ignore[assignment]
    *("Eq.", "Eqs.", "Fig.", "Figs."),  # these end no sentence
)

nb_execution_mode = "off"
nb_code_prompt_show = "code"
nb_code_prompt_hide = "hide the code"
myst_enable_extensions = ["attrs_block", "attrs_inline", "colon_fence", "dollarmath"]
myst_heading_anchors = 3

linkcode_resolve = source_of  # a page of coloured code for each module would weigh seven times more
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_type_aliases = {
    name: name for name in ("Array", "Floats", "Ints", "Stream", "Words", "Value", "Entity")
}  # written out, an array takes a line of each signature
napoleon_google_docstring = False
napoleon_use_rtype = False
add_module_names = False
suppress_warnings = ["ref.python"]  # a word of a docstring may be the name of several attributes
toc_object_entries_show_parents = "hide"

html_theme = "sphinx_book_theme"
html_title = "Unified IRL, replicated"
html_theme_options = {
    "use_download_button": False,
    "use_fullscreen_button": False,
    "navbar_persistent": [],
    "home_page_in_toc": True,
    "max_navbar_depth": 1,
    "show_toc_level": 2,
    "pygments_light_style": "a11y-high-contrast-light",
    "pygments_dark_style": "a11y-high-contrast-dark",
    "footer_content_items": ["copyright.html"],
}
html_context = {"default_mode": "auto"}
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["sortable.min.js", "sortable.a11y.min.js"]
html_math_renderer = "mathml"
html_search_scorer = str(Path(__file__).parent / "scorer.js")
html_copy_source = False
html_show_sourcelink = False
html_last_updated_fmt = None
html_show_sphinx = False
html_sidebars: dict[str, list[str]] = {"api/modules/*": []}  # a third of what a short page weighs
html_domain_indices = False  # the reference lists the modules itself
