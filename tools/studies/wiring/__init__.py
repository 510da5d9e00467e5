"""How often is a wrong wiring named, and a right one left alone?"""
