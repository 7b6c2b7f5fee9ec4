//! A bounding-volume hierarchy over triangles, for closest points, box overlaps and rays.
//!
//! In: vertices and triangles. The tree is built from the root down; every node splits its
//! triangles at the median of their centroids along the longest axis of the centroids' box.
//!
//! Guaranteed: queries are exact, and of several equal results the one with the lowest triangle
//! index is returned, so results do not depend on the shape of the tree or the number of threads.
//! Building takes O(n log n), a closest-point query on a smooth surface O(log n).

use super::{Vec3, triangle};

/// Largest number of triangles in a leaf. Smaller leaves mean more nodes, larger ones more
/// triangle tests; 4 was the fastest of 2, 4 and 8.
const LEAF_SIZE: usize = 4;

/// Smallest number of triangles in a half of a subtree for which both halves are built in
/// parallel.
const PARALLEL_SIZE: usize = 2048;

/// An axis-aligned bounding box, mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The box that contains nothing.
    pub fn empty() -> Self {
        Self {
            min: Vec3::repeat(f64::INFINITY),
            max: Vec3::repeat(f64::NEG_INFINITY),
        }
    }

    /// The smallest box that contains some points.
    pub fn of<'a>(points: impl IntoIterator<Item = &'a Vec3>) -> Self {
        let mut aabb = Self::empty();
        for p in points {
            aabb.min = aabb.min.zip_map(p, lesser);
            aabb.max = aabb.max.zip_map(p, greater);
        }
        aabb
    }

    /// The smallest box that contains both.
    pub fn union(&self, other: &Self) -> Self {
        Self {
            min: self.min.zip_map(&other.min, lesser),
            max: self.max.zip_map(&other.max, greater),
        }
    }

    /// Whether the boxes have a point in common; touching counts.
    pub fn overlaps(&self, other: &Self) -> bool {
        (0..3).all(|r| self.min[r] <= other.max[r] && other.min[r] <= self.max[r])
    }

    /// The squared distance from `p` to the box, mm²; 0 inside.
    pub fn squared_distance(&self, p: &Vec3) -> f64 {
        let outside = |r: usize| greater(greater(self.min[r] - p[r], p[r] - self.max[r]), 0.0);
        let [x, y, z] = [outside(0), outside(1), outside(2)];
        x * x + y * y + z * z
    }
}

/// Margin by which boxes are extended in ray queries, mm. It exceeds the rounding errors of
/// coordinates up to metres, so that no triangle is missed.
const SLACK: f64 = 1e-9;

/// A ray prepared for tests against boxes.
struct BoxRay {
    start: Vec3,
    /// The reciprocals of the direction's components.
    inverse: Vec3,
}

impl BoxRay {
    /// Whether the ray meets the box: its intervals within the three slabs overlap.
    fn meets(&self, aabb: &Aabb) -> bool {
        let (mut enters, mut leaves) = (0.0, f64::INFINITY);
        for a in 0..3 {
            let one = (aabb.min[a] - self.start[a] - SLACK) * self.inverse[a];
            let other = (aabb.max[a] - self.start[a] + SLACK) * self.inverse[a];
            enters = greater(lesser(one, other), enters);
            leaves = lesser(greater(one, other), leaves);
        }
        enters <= leaves
    }
}

/// The smaller of two numbers, the second if they cannot be compared. This is a single
/// instruction, whereas nalgebra's `inf` and `sup` branch.
#[inline]
fn lesser(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

/// The greater of two numbers, the second if they cannot be compared.
#[inline]
fn greater(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}

/// The result of a closest-point query.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closest {
    /// Index of the triangle that contains the point.
    pub triangle: u32,
    /// The point's barycentric coordinates in the triangle.
    pub barycentric: [f64; 3],
    /// The point itself, mm.
    pub point: Vec3,
    /// Squared distance from the queried position, mm².
    pub squared_distance: f64,
}

#[derive(Debug, Clone)]
struct Node {
    aabb: Aabb,
    /// For a leaf, its first entry in `order`; for an inner node, the index of the right child.
    /// The left child follows its parent.
    first_or_right: u32,
    /// Number of triangles in a leaf; 0 for an inner node.
    count: u32,
}

/// A leaf of a tree.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Leaf(u32);

/// The tree. It has its own copy of the corners, in the order of the leaves, which are therefore
/// close together in memory.
#[derive(Debug, Clone)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// The triangles in the order of the leaves.
    order: Vec<u32>,
    /// The place of each triangle in `order`.
    slots: Vec<u32>,
    /// The corners of the triangles, in the order of the leaves.
    corners: Vec<[Vec3; 3]>,
    /// The boxes of the triangles, in the same order.
    boxes: Vec<Aabb>,
}

impl Bvh {
    /// Builds the tree over `triangles`, which are indices into `vertices`.
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn new(vertices: &[Vec3], triangles: &[[u32; 3]]) -> Self {
        let corners: Vec<[Vec3; 3]> = triangles
            .iter()
            .map(|t| t.map(|v| vertices[v as usize]))
            .collect();
        let centroids: Vec<Vec3> = corners.iter().map(|[a, b, c]| (a + b + c) / 3.0).collect();
        let boxes: Vec<Aabb> = corners.iter().map(Aabb::of).collect();
        let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut nodes = Vec::with_capacity(triangles.len().max(1));
        if !order.is_empty() {
            build(&mut nodes, &mut order, 0, &boxes, &centroids);
        }
        let corners = order.iter().map(|&t| corners[t as usize]).collect();
        let boxes = order.iter().map(|&t| boxes[t as usize]).collect();
        let mut slots = vec![0; order.len()];
        for (slot, &t) in (0..).zip(&order) {
            slots[t as usize] = slot;
        }
        Self {
            nodes,
            order,
            slots,
            corners,
            boxes,
        }
    }

    /// The point of all triangles that is closest to `p`; `None` only for an empty tree.
    pub fn closest(&self, p: &Vec3) -> Option<Closest> {
        self.closest_where(p, |_| true)
    }

    /// The closest point on the triangles for which `admits` is true, for example those that face
    /// the right way, to exclude the opposite side of a thin wall. `None` if there are none.
    pub fn closest_where(&self, p: &Vec3, admits: impl Fn(u32) -> bool) -> Option<Closest> {
        self.closest_from(p, None, admits)
    }

    /// [`closest_where`](Self::closest_where) with a guess: a triangle that is probably near `p`,
    /// such as the result for a neighbouring point. The guess affects the time but not the
    /// result; one that is not a triangle of the tree is ignored.
    pub fn closest_from(
        &self,
        p: &Vec3,
        guess: Option<u32>,
        admits: impl Fn(u32) -> bool,
    ) -> Option<Closest> {
        let guessed = guess.filter(|t| (*t as usize) < self.slots.len() && admits(*t));
        let mut best = guessed.map(|t| self.closest_in(self.slots[t as usize] as usize, p));
        let mut bound = best.map_or(f64::INFINITY, |found| found.squared_distance);
        // The depth is at most log2 of 2^32 triangles, and each level adds one waiting node.
        let mut stack = [(0u32, 0.0f64); 64];
        let mut height = 0;
        if let Some(root) = self.nodes.first() {
            stack[0] = (0, root.aabb.squared_distance(p));
            height = 1;
        }
        while height > 0 {
            height -= 1;
            let (index, distance) = stack[height];
            if distance > bound {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count == 0 {
                let (left, right) = (index + 1, node.first_or_right);
                let dl = self.nodes[left as usize].aabb.squared_distance(p);
                let dr = self.nodes[right as usize].aabb.squared_distance(p);
                let ((near, dn), (far, df)) = if dl <= dr {
                    ((left, dl), (right, dr))
                } else {
                    ((right, dr), (left, dl))
                };
                if df <= bound {
                    stack[height] = (far, df);
                    height += 1;
                }
                if dn <= bound {
                    stack[height] = (near, dn);
                    height += 1;
                }
                continue;
            }
            self.improve_in_leaf(node, p, &admits, &mut best);
            bound = best.map_or(bound, |found| found.squared_distance);
        }
        best
    }

    /// Replaces `best` by the closest point on an admitted triangle of a leaf, if that is nearer or,
    /// at the same distance, on a lower triangle.
    #[inline]
    fn improve_in_leaf(
        &self,
        leaf: &Node,
        p: &Vec3,
        admits: &impl Fn(u32) -> bool,
        best: &mut Option<Closest>,
    ) {
        for slot in self.slots_of(leaf) {
            let triangle = self.order[slot];
            let bound = best.map_or(f64::INFINITY, |found| found.squared_distance);
            // The triangle's own box is faster to test than its closest point, and rules out most
            // triangles.
            if self.boxes[slot].squared_distance(p) > bound || !admits(triangle) {
                continue;
            }
            let found = self.closest_in(slot, p);
            let is_nearer = best.is_none_or(|known| {
                found.squared_distance < known.squared_distance
                    || (found.squared_distance == known.squared_distance
                        && triangle < known.triangle)
            });
            if is_nearer {
                *best = Some(found);
            }
        }
    }

    /// The closest point on the triangle in a slot.
    fn closest_in(&self, slot: usize, p: &Vec3) -> Closest {
        let [a, b, c] = &self.corners[slot];
        let [u, v, w] = triangle::closest_barycentric(p, a, b, c);
        let point = a * u + b * v + c * w;
        Closest {
            triangle: self.order[slot],
            barycentric: [u, v, w],
            point,
            squared_distance: (point - p).norm_squared(),
        }
    }

    /// The leaves, in the order of the tree.
    pub fn leaves(&self) -> Vec<Leaf> {
        (0..self.nodes.len() as u32)
            .filter(|&n| self.nodes[n as usize].count > 0)
            .map(Leaf)
            .collect()
    }

    /// Calls `visit` with the pairs of triangles, lower index first, whose bounding boxes overlap and of which
    /// one is in `leaf` and the other in it, too, or in a later leaf. Over all leaves that is every such
    /// pair once. One search for all triangles of a leaf is several times as fast as one for each.
    pub fn for_each_pair_from(&self, leaf: Leaf, mut visit: impl FnMut(u32, u32)) {
        let Leaf(own) = leaf;
        let slots = self.slots_of(&self.nodes[own as usize]);
        let aabb = self.nodes[own as usize].aabb;
        let mut stack = [0u32; 64];
        let mut height = 1;
        while height > 0 {
            height -= 1;
            let index = stack[height];
            let node = &self.nodes[index as usize];
            if !node.aabb.overlaps(&aabb) {
                continue;
            }
            if node.count == 0 {
                stack[height] = node.first_or_right;
                height += 1;
                // The left half ends before the right one begins: earlier leaves have had their turn.
                if node.first_or_right > own {
                    stack[height] = index + 1;
                    height += 1;
                }
                continue;
            }
            for other in self.slots_of(node) {
                let other_box = &self.boxes[other];
                if !other_box.overlaps(&aabb) {
                    continue;
                }
                for slot in slots.clone() {
                    if slot < other && self.boxes[slot].overlaps(other_box) {
                        let (s, t) = (self.order[slot], self.order[other]);
                        visit(s.min(t), s.max(t));
                    }
                }
            }
        }
    }

    /// The places of a leaf's triangles in `order`.
    fn slots_of(&self, leaf: &Node) -> std::ops::Range<usize> {
        let first = leaf.first_or_right as usize;
        first..first + leaf.count as usize
    }

    /// Calls `visit` with every triangle whose bounding box the ray from `start` in `direction`
    /// meets, in the order of the tree: all those that the ray itself may meet.
    pub fn for_each_along(&self, start: &Vec3, direction: &Vec3, mut visit: impl FnMut(u32)) {
        let ray = BoxRay {
            start: *start,
            inverse: direction.map(|x| 1.0 / x),
        };
        let mut stack = [0u32; 64];
        let mut height = usize::from(!self.nodes.is_empty());
        while height > 0 {
            height -= 1;
            let index = stack[height];
            let node = &self.nodes[index as usize];
            if !ray.meets(&node.aabb) {
                continue;
            }
            if node.count == 0 {
                stack[height] = node.first_or_right;
                stack[height + 1] = index + 1;
                height += 2;
                continue;
            }
            for slot in self.slots_of(node) {
                if ray.meets(&self.boxes[slot]) {
                    visit(self.order[slot]);
                }
            }
        }
    }
}

/// Appends the subtree over `order`, whose first entry has the place `offset` in the whole.
fn build(
    nodes: &mut Vec<Node>,
    order: &mut [u32],
    offset: usize,
    boxes: &[Aabb],
    centroids: &[Vec3],
) {
    let index = nodes.len();
    nodes.push(Node {
        aabb: Aabb::empty(),
        first_or_right: offset as u32,
        count: order.len() as u32,
    });
    if order.len() <= LEAF_SIZE {
        let all = order.iter().map(|&t| &boxes[t as usize]);
        nodes[index].aabb = all.fold(Aabb::empty(), |aabb, other| aabb.union(other));
        return;
    }
    let spread = Aabb::of(order.iter().map(|&t| &centroids[t as usize]));
    let axis = (spread.max - spread.min).imax();
    let middle = order.len() / 2;
    order.select_nth_unstable_by(middle, |&s, &t| {
        centroids[s as usize][axis]
            .total_cmp(&centroids[t as usize][axis])
            .then(s.cmp(&t))
    });
    let (left, right) = order.split_at_mut(middle);
    let right_index;
    if middle < PARALLEL_SIZE {
        build(nodes, left, offset, boxes, centroids);
        right_index = nodes.len();
        build(nodes, right, offset + middle, boxes, centroids);
    } else {
        let build_apart = |order, offset| {
            let mut nodes = Vec::new();
            build(&mut nodes, order, offset, boxes, centroids);
            nodes
        };
        let (left, right) = rayon::join(
            || build_apart(left, offset),
            || build_apart(right, offset + middle),
        );
        append(nodes, left);
        right_index = nodes.len();
        append(nodes, right);
    }
    nodes[index] = Node {
        aabb: nodes[index + 1].aabb.union(&nodes[right_index].aabb),
        first_or_right: right_index as u32,
        count: 0,
    };
}

/// Appends a subtree that was built separately.
fn append(nodes: &mut Vec<Node>, subtree: Vec<Node>) {
    let shift = nodes.len() as u32;
    nodes.extend(subtree.into_iter().map(|mut node| {
        if node.count == 0 {
            node.first_or_right += shift;
        }
        node
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn closest_point_agrees_with_brute_force() {
        let mesh = shapes::torus(9.0, 3.0, 40, 17);
        let bvh = Bvh::new(&mesh.vertices, &mesh.triangles);
        for i in 0..300 {
            let t = f64::from(i);
            let p = Vec3::new((t * 1.7).sin(), (t * 0.9).cos(), (t * 2.3).sin()) * 12.0;
            let found = bvh.closest(&p).unwrap();
            let brute = mesh
                .triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
                    let [u, v, w] = triangle::closest_barycentric(&p, &a, &b, &c);
                    (a * u + b * v + c * w - p).norm_squared()
                })
                .fold(f64::INFINITY, f64::min);
            assert_eq!(found.squared_distance, brute);
            for guess in [0, i as u32 * 4, 1359, u32::MAX] {
                assert_eq!(bvh.closest_from(&p, Some(guess), |_| true), Some(found));
            }
        }
    }

    #[test]
    fn the_pairs_from_all_leaves_are_the_boxes_that_touch() {
        let mesh = shapes::torus(9.0, 3.0, 40, 17);
        let bvh = Bvh::new(&mesh.vertices, &mesh.triangles);
        let mut found = Vec::new();
        for leaf in bvh.leaves() {
            bvh.for_each_pair_from(leaf, |s, t| found.push((s, t)));
        }
        found.sort_unstable();
        let aabb = |t: u32| Aabb::of(&mesh.corners(t as usize));
        let all = 0..mesh.triangles.len() as u32;
        let expected: Vec<(u32, u32)> = (all.clone())
            .flat_map(|s| all.clone().map(move |t| (s, t)))
            .filter(|&(s, t)| s < t && aabb(s).overlaps(&aabb(t)))
            .collect();
        assert!(expected.len() > mesh.triangles.len());
        assert_eq!(found, expected);
        assert!(Bvh::new(&[], &[]).leaves().is_empty());
    }

    #[test]
    fn halves_built_in_parallel_make_the_same_tree() {
        let mesh = shapes::icosphere(5.0, 5);
        let tree = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
            let pool = pool.build().unwrap();
            pool.install(|| Bvh::new(&mesh.vertices, &mesh.triangles))
        };
        let one = tree(1);
        assert!(one.order.len() > 4 * PARALLEL_SIZE);
        let many = tree(3);
        assert_eq!(format!("{:?}", one.nodes), format!("{:?}", many.nodes));
        // Every triangle is the closest to its own centroid, so the parts fit together.
        for t in (0..mesh.triangles.len()).step_by(97) {
            let [a, b, c] = mesh.corners(t);
            let found = many.closest(&((a + b + c) / 3.0)).unwrap();
            assert_eq!(found.triangle, t as u32);
        }
    }

    #[test]
    fn ray_queries_miss_no_triangle() {
        let mesh = shapes::torus(9.0, 3.0, 40, 17);
        let bvh = Bvh::new(&mesh.vertices, &mesh.triangles);
        let (mut met, mut asked) = (0, 0);
        for i in 0..300 {
            let t = f64::from(i);
            let start = Vec3::new((t * 1.7).sin(), (t * 0.9).cos(), (t * 2.3).sin()) * 12.0;
            // Some directions are axes, with components that are 0.
            let direction = match i % 4 {
                3 => Vec3::new((t * 0.3).cos(), (t * 1.1).sin(), (t * 0.7).cos()).normalize(),
                axis => Vec3::ith(axis as usize, 1.0),
            };
            let mut near = Vec::new();
            bvh.for_each_along(&start, &direction, |t| near.push(t));
            asked += near.len();
            for triangle in 0..mesh.triangles.len() {
                let [a, b, c] = mesh.corners(triangle);
                if triangle::ray_distance(&start, &direction, &a, &b, &c).is_some() {
                    assert!(near.contains(&(triangle as u32)), "{i}: {triangle}");
                    met += 1;
                }
            }
        }
        assert!(met > 80, "{met}");
        assert!(asked < 300 * mesh.triangles.len() / 20, "{asked}");
    }
}
