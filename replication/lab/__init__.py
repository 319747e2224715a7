"""The maze lab: draw a maze, drive demonstrations and watch the methods learn, in the browser.

``numbers.js``, ``learner.js`` and ``irl.js`` compute trials with the bits of Python's, in a worker;
``maze.js`` is what can be drawn, ``pictures.js`` how it looks, ``app.js`` the page. ``learner.wat``
is the learner once more, as WebAssembly.
"""
