"""Closing the loop: the residual of a model, the physical effect behind the residual, and the repaired model.

The rooms are the stages of the method: `residual`, `regression`, `selection`, `repair`, `report`; `monitor` watches.
"""
