"""The maze lab: draw a maze, drive demonstrations and watch the methods learn, in the browser.

``numbers.js``, ``learner.js`` and ``irl.js`` compute trials with the bits of Python's, in a worker;
``learner.wat`` is the learner once more, as WebAssembly. ``maze.js`` is what can be drawn,
``pictures.js`` how it looks, and the other scripts are the parts of the page.
"""
