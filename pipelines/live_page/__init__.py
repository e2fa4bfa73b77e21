"""The live page: what a recording shows in a browser while it runs.

``live_page`` the recorder's side · ``side_buffer`` lossy, so that nothing waits · ``pipe_frames`` between the two
processes · ``page_process`` the other side: ``page_state`` what is shown, ``web_server`` to whom.
"""
