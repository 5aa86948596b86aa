from .budget import DEFAULT_BUDGET as DEFAULT_BUDGET, Budget as Budget, BudgetError as BudgetError
from .isolation import ChildError as ChildError, Isolated as Isolated, run_isolated as run_isolated
from .message import Message as Message
