"""The fill level as an input of the network: five fills of the numerical tank, each left out in turn."""
