"""The public names and where they are, for type checkers, editors and `__init__.py`, which reads them from here."""

from .arviz_bridge import open_posterior as open_posterior
from .assess.bands import credible_band as credible_band
from .assess.correlation import correlation_factors as correlation_factors
from .assess.loops import loop_quantities as loop_quantities
from .assess.transformation import transformation_temperatures as transformation_temperatures
from .conditions.draws import record_draws as record_draws
from .conditions.effects import operating_effects as operating_effects
from .conditions.features import condition_features as condition_features
from .errors import SmaBayesError as SmaBayesError
from .inference.jobs import cluster as cluster
from .paper.twin import twin_campaign as twin_campaign
from .parameters.priors_file import read_priors as read_priors
from .records.campaign import read_campaign as read_campaign
from .records.memory import campaign_of as campaign_of
from .records.starting_file import start_campaign as start_campaign
from .records.types import Campaign as Campaign
from .records.types import Condition as Condition
from .records.types import Record as Record
from .report.stored_draws import stored_draws as stored_draws
from .reproduction.build import reproduce_paper as reproduce_paper
from .results.fitting import fit_records as fit_records
from .workflow.campaign_fit import fit as fit
from .workflow.campaign_fit import fit_campaign as fit_campaign
from .workflow.comparison import compare as compare
from .workflow.condition_study import study_conditions as study_conditions
from .workflow.difference import diff as diff
from .workflow.fitted import Fits as Fits
from .workflow.fitted import RecordFit as RecordFit
from .workflow.gap_study import study_gap as study_gap
from .workflow.inspection import inspect_campaign as inspect_campaign
from .workflow.question import ask as ask
from .workflow.study import run_study as run_study

__version__: str
__all__: list[str]
