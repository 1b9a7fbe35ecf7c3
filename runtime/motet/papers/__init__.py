"""What the three papers' own systems need when they run, and nobody else.

    thesis (temporal deep belief net): script (control_script.py) -> control values -> a chain of Gibbs iterations
    (gibbs_chain.py) -> frames, smoothed by frames ahead (lookahead.py) -> tdbn_control.py
    Plappert et al. 2017: sentence -> context vector -> frames drawn from a mixture (mixture.py) -> mixture_model.py

Li et al. 2018 predicts by the loop of motet.predict.

Main names: TdbnModel and TdbnSession (tdbn_control.py), Lookahead (lookahead.py), MixtureModel (mixture_model.py),
mixture_search (mixture.py).
Numbers: TickSettings (gibbs_chain.py), LookaheadSettings (lookahead.py), MixtureSettings (mixture.py), in the manifest.
"""
