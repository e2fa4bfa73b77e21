"""The blind proof: a laboratory whose truth is sealed before anything is diagnosed.

`laboratory` and `hidden_physics` make cases, `sealing` commits to their truths and locks them away, `running` has
each diagnosed by a process of its own, `scoring` opens the truths and counts. The laboratory shares no code with
the twin or the diagnosis: neither equations of motion, nor integrator, nor file writer.
"""
