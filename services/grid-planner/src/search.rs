//! A* over the eight neighbours of a cell (Hart, Nilsson and Raphael 1968; ASN-130), without cutting corners.

use crate::field::Field;
use crate::grid::DIRECTIONS;
use crate::queue::BucketQueue;

/// Cost of a straight step. 1393 / 985 is √2 to within 4e-7, so integer costs order paths as their lengths
/// do.
pub const STRAIGHT: u32 = 985;
/// Cost of a diagonal step.
pub const DIAGONAL: u32 = 1393;
const STEPS: [u32; 8] = [STRAIGHT, DIAGONAL, STRAIGHT, DIAGONAL, STRAIGHT, DIAGONAL, STRAIGHT, DIAGONAL];

/// No direction: the start.
const NOWHERE: u32 = 8;
const CLOSED: u32 = 16;

/// What is known of a cell.
#[derive(Debug, Clone, Copy, Default)]
struct Node {
    /// Cost from the start.
    cost: u32,
    /// Bits 0 to 3: the direction by which it was reached; bit 4: closed; above: the search in which all this
    /// was written.
    tag: u32,
}

/// The memory of the search, used again for every plan.
#[derive(Debug, Clone, Default)]
pub struct Search {
    nodes: Vec<Node>,
    generation: u32,
    queue: BucketQueue,
    cells: Vec<u32>,
    expanded: u64,
}

impl Search {
    /// The cheapest way from one cell to another, both included, as flat indices; `None` where there is none.
    /// The caller makes sure that both lie within the grid. On a field without costs only the canonical ones
    /// among equally short paths are searched (Harabor and Grastien 2012, "The JPS pathfinding system", the
    /// rules without corner cutting, step by step).
    pub fn find(&mut self, field: &Field, start: usize, goal: usize) -> Option<&[u32]> {
        self.expanded = 0;
        self.cells.clear();
        if field.is_blocked(start) || field.is_blocked(goal) {
            return None;
        }
        self.begin(field.len());
        let found = if field.has_costs() {
            self.run::<true>(field, start, goal)
        } else {
            self.run::<false>(field, start, goal)
        };
        if !found {
            return None;
        }
        let offsets = field.offsets();
        let mut cell = goal;
        self.cells.push(cell as u32);
        while cell != start {
            let direction = (self.nodes[cell].tag & 15) as usize;
            cell = cell.wrapping_add_signed(-offsets[direction & 7]);
            self.cells.push(cell as u32);
        }
        self.cells.reverse();
        Some(&self.cells)
    }

    /// Cells expanded by the last search.
    pub fn expanded(&self) -> u64 {
        self.expanded
    }

    /// Makes every cell unknown without touching it.
    fn begin(&mut self, cells: usize) {
        self.generation += 1;
        if self.nodes.len() != cells || self.generation >= 1 << 27 {
            self.nodes.clear();
            self.nodes.resize(cells, Node::default());
            self.generation = 1;
        }
    }

    fn run<const COSTS: bool>(&mut self, field: &Field, start: usize, goal: usize) -> bool {
        let Self { nodes, queue, .. } = self;
        let nodes = nodes.as_mut_slice();
        let written = self.generation << 5;
        let stride = field.stride() as u32;
        let (offsets, moves, extra) = (field.offsets(), field.moves(), field.extra());
        let (goal_x, goal_y) = ((goal as u32 % stride) as i32, (goal as u32 / stride) as i32);
        let estimate = |x: i32, y: i32| {
            let (dx, dy) = (x.abs_diff(goal_x), y.abs_diff(goal_y));
            dx.max(dy) * STRAIGHT + dx.min(dy) * (DIAGONAL - STRAIGHT)
        };
        let first = estimate((start as u32 % stride) as i32, (start as u32 / stride) as i32);
        queue.restart(first);
        queue.push(first, start as u32);
        nodes[start] = Node { cost: 0, tag: written | NOWHERE };
        let mut expanded = 0;
        while let Some(cell) = queue.pop() {
            let node = &mut nodes[cell as usize];
            if node.tag & CLOSED != 0 {
                continue;
            }
            node.tag |= CLOSED;
            expanded += 1;
            if cell as usize == goal {
                self.expanded = expanded;
                return true;
            }
            let (cost, came) = (node.cost, (node.tag & 15) as usize);
            let (x, y) = ((cell % stride) as i32, (cell / stride) as i32);
            let mut open = moves[cell as usize];
            if !COSTS {
                open &= CANONICAL[came][open as usize];
            }
            while open != 0 {
                let direction = open.trailing_zeros() as usize;
                open &= open - 1;
                let next = (cell as usize).wrapping_add_signed(offsets[direction]);
                let mut reached = cost + STEPS[direction];
                if COSTS {
                    reached += (STEPS[direction] * u32::from(extra[next][direction])) >> 4;
                }
                let node = &mut nodes[next];
                if node.tag & !31 == written && (node.tag & CLOSED != 0 || reached >= node.cost) {
                    continue;
                }
                *node = Node { cost: reached, tag: written | direction as u32 };
                let (dx, dy) = DIRECTIONS[direction];
                queue.push(reached + estimate(x + dx, y + dy), next as u32);
            }
        }
        self.expanded = expanded;
        false
    }
}

/// For the direction by which a cell was reached and the moves that are open there: the moves that a shortest
/// path may need. A diagonal step goes on diagonally or by its two components. A straight one goes on
/// straight; it turns only where the cell beside its last one is not reachable from there, which the closed
/// diagonal backwards shows.
static CANONICAL: [[u8; 256]; 9] = canonical();

const fn canonical() -> [[u8; 256]; 9] {
    let mut table = [[0xff; 256]; 9];
    let mut came = 0;
    while came < 8 {
        let mut open = 0;
        while open < 256 {
            table[came][open] = canonical_moves(came, open as u8);
            open += 1;
        }
        came += 1;
    }
    table
}

const fn canonical_moves(came: usize, open: u8) -> u8 {
    let ahead = 1_u8 << came;
    if came % 2 == 1 {
        return ahead | 1 << ((came + 1) % 8) | 1 << ((came + 7) % 8);
    }
    let mut moves = ahead;
    let mut side = 2;
    while side <= 6 {
        // Beside it, diagonally forward on that side, diagonally backward on that side.
        let beside = 1_u8 << ((came + side) % 8);
        let (forward, backward) = if side == 2 { (1, 3) } else { (7, 5) };
        if open & beside != 0 && open & (1 << ((came + backward) % 8)) == 0 {
            moves |= beside | 1 << ((came + forward) % 8);
        }
        side += 4;
    }
    moves
}
