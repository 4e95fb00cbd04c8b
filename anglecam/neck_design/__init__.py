"""The paper's design calculations: an application on top of the equations in `anglecam.neck`.

`procedure` and `systems` turn a user's options into what the equations take. `results` holds a frozen dataclass for
each verb of ``anglecam neck``, `render` turns any of them into JSON and tables, and `figures` draws them.
"""
