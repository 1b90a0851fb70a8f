"""One mechanism for the eye: equations, parameters, joints, what the engines hold, and a picture.

May use ``report`` and what is below it.

Start with ``exhibit``, which gathers what a page and the terminal show; ``gallery`` draws the pictures of the report, and ``card`` is
what a notebook shows of a mechanism. A ``Drawing`` stands alone.
"""
