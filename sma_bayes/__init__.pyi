"""The public names and where they are, for type checkers, editors and `__init__.py`, which reads them from here."""

from .arviz_bridge import open_posterior as open_posterior
from .assess.bands import credible_band as credible_band
from .assess.correlation import correlation_factors as correlation_factors
from .assess.draws import record_draws as record_draws
from .assess.loops import loop_quantities as loop_quantities
from .assess.transformation import transformation_temperatures as transformation_temperatures
from .errors import SmaBayesError as SmaBayesError
from .fitting.fit_records import fit_records as fit_records
from .fitting.least_squares import LeastSquares as LeastSquares, least_squares as least_squares
from .paper.twin import twin_campaign as twin_campaign
from .parameters.priors_file import read_priors as read_priors
from .records.campaign import read_campaign as read_campaign
from .records.memory import campaign_of as campaign_of
from .records.types import Campaign as Campaign, Condition as Condition, Record as Record
from .runs.jobs import cluster as cluster
from .runs.stored_draws import stored_draws as stored_draws
from .simulated.campaign import simulated_campaign as simulated_campaign
from .studies.ask.workflow import ask as ask
from .studies.card.workflow import card as card
from .studies.compare.workflow import compare as compare
from .studies.conditions.effects import operating_effects as operating_effects
from .studies.conditions.features import condition_features as condition_features
from .studies.conditions.workflow import study_conditions as study_conditions
from .studies.cycles.workflow import cycles as cycles
from .studies.diff.workflow import diff as diff
from .studies.fit.fitted import Fits as Fits, RecordFit as RecordFit
from .studies.fit.workflow import fit as fit, fit_campaign as fit_campaign
from .studies.gap.workflow import study_gap as study_gap
from .studies.init.workflow import start_campaign as start_campaign
from .studies.inspect.workflow import inspect_campaign as inspect_campaign
from .studies.modulus.workflow import modulus as modulus
from .studies.paper.build import reproduce_paper as reproduce_paper
from .studies.plan.workflow import plan as plan
from .studies.run.workflow import run_study as run_study
from .studies.sensitivity.workflow import sensitivity as sensitivity
from .studies.simulate.workflow import simulate as simulate
from .studies.watch.workflow import watch as watch

__version__: str
__all__: list[str]
