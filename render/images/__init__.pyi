from .check import Problem as Problem
from .check import check_database as check_database
from .database import Database as Database
from .database import read_database as read_database
from .writing import Grid as Grid
from .writing import write_database as write_database
