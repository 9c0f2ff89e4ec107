"""HTML pages that load nothing: what all of them have in common, for a page's own template to extend."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Template


def page_template(package: str) -> "Template":
    """The template ``page.html`` of a package, which extends ``frame.html`` of this one.

    The frame has the head, the style that pages share and the package's own ``page.css``, and the blocks "title",
    "body" and "script".
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package, "."), PackageLoader("qvi_contact.basics", ".")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html")
