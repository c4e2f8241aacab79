"""Findings: what is wrong or worth knowing about readings and fits, each by name."""

from agonic.health.decoding import undo_decoding as undo_decoding
from agonic.health.evidence import FEWEST as FEWEST
from agonic.health.evidence import RECORD_LONGER as RECORD_LONGER
from agonic.health.evidence import Evidence as Evidence
from agonic.health.examine import examine as examine
from agonic.health.finding import Finding as Finding
from agonic.health.finding import Judged as Judged
from agonic.health.finding import Verdict as Verdict
from agonic.health.finding import figure as figure
from agonic.health.finding import sentences as sentences
from agonic.health.finding import sort_findings as sort_findings
from agonic.health.finding import verdict_of as verdict_of
from agonic.health.mounting import REVERSED_FIELD as REVERSED_FIELD
from agonic.health.mounting import check_axes as check_axes
from agonic.health.mounting import check_mounting as check_mounting
from agonic.health.mounting import find_mounting as find_mounting
from agonic.health.mounting import find_side as find_side
from agonic.health.readings import check_rejected as check_rejected
from agonic.health.readings import describe as describe
from agonic.health.readings import inspect as inspect
from agonic.health.scale import check_magnitude as check_magnitude
from agonic.health.scale import check_resolution as check_resolution
from agonic.health.scale import check_scale as check_scale
from agonic.health.scale import find_quantisation as find_quantisation
from agonic.health.scale import find_rounding as find_rounding
from agonic.health.sticking import find_usable_rows as find_usable_rows
